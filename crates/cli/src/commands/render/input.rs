//! Input of `render`: the picture, and its depth, which is given, computed, or found in the photo.

use std::path::Path;
use std::sync::Arc;

use super::RenderCommand;
use crate::error::CliError;
use crate::log;
use crate::plausible;
use bokehcam::depth::defocus;
use bokehcam::depth::focus::FocusRule;
use bokehcam::depth::matting::mask::{Outline, depth_from_mask};
use bokehcam::engine::still::Depth;
use bokehcam::frame::{ColorImage, DepthMap, Mask};
use bokehcam::look::{Look, Refine};
use bokehcam::recording::depth_file::{DepthFile, DepthUnit};
use bokehcam::recording::{PhotoMetadata, snapshot, still};
use bokehcam::source::photo::{self, PhotoDepth};
use bokehcam::source::{self, DepthChoice, DepthOrigin};

/// Input of the blur.
pub(super) struct Input {
    pub color: ColorImage,
    pub metadata: PhotoMetadata,
    pub depth: Option<Depth>,
    /// The origin of the depth.
    pub depth_from: DepthOrigin,
    /// Depth that was found in or beside the photo.
    pub found: Option<FoundDepth>,
}

/// Depth that the photo brings without an option for it.
pub(super) struct FoundDepth {
    pub measured: bool,
    pub by: String,
    /// The focus that the photo was taken with, which replaces `auto`.
    pub focus: Option<FocusRule>,
}

/// Reads the picture, its metadata, and its depth, if any. Inputs not named in the command come from the snapshot of
/// `--like`; its depth is already refined and is not refined again.
pub(super) fn read_input(command: &RenderCommand, look: &Look) -> Result<Input, CliError> {
    let sources = command.like.as_ref().map(|like| snapshot::source_paths(like));
    let is_given = command.depth_map.is_some() || command.mask.is_some();
    let is_automatic = matches!(command.blur.depth, DepthChoice::Auto | DepthChoice::Recorded);
    let searches_depth = !is_given && is_automatic;
    let (image, kept_depth) = match (&command.image, sources) {
        (None, Some((color, depth))) => (color, Some(depth).filter(|depth| !is_given && depth.exists())),
        // A snapshot stands for the picture that it was made from.
        (Some(image), _) if searches_depth => (photo::original_path(image), None),
        // clap requires an image without `--like`.
        (image, _) => (image.clone().unwrap_or_default(), None),
    };
    let (color, metadata) = still::read_photo(&image)?;
    let mut input = Input { color, metadata, depth: None, depth_from: DepthOrigin::Nothing, found: None };
    if let Some(made) = compute_depth(command, look, &input.color)? {
        // Masks and networks have their own scale.
        (input.depth, input.depth_from) = (Some(made), DepthOrigin::Metres);
    } else if let Some(file) = &command.depth_map {
        let (mut map, from) = read_depth(file, command, look, &input.color)?;
        source::find_person(&command.source_options(), look, &input.color, &mut map);
        (input.depth, input.depth_from) = (Some(Depth::Measured(map)), from);
    } else if let Some(file) = kept_depth {
        let (map, from) = read_depth(&file, command, look, &input.color)?;
        (input.depth, input.depth_from) = (Some(Depth::Final(map)), from);
    } else if command.image.is_some() && searches_depth && look.effect.follows_depth() {
        find_depth(&image, command, look, &mut input)?;
    }
    Ok(input)
}

/// Finds the depth of a photo as a stream of it does: beside it, or by an installed network.
fn find_depth(image: &Path, command: &RenderCommand, look: &Look, input: &mut Input) -> Result<(), CliError> {
    let color = Arc::new(std::mem::take(&mut input.color));
    let (found, notes) = photo::read_default_depth(image, &color, &command.source_options(), look)?;
    input.color = Arc::unwrap_or_clone(color);
    notes.iter().for_each(|note| log::note(note));
    let Some(PhotoDepth { map, from, measured, by, original, focus }) = found else { return Ok(()) };
    if from == DepthOrigin::Networks {
        plausible::warn_of_subject(None, &map, None);
    }
    input.found = Some(FoundDepth { measured, by, focus });
    if let Some(original) = original {
        input.color = original;
    }
    input.depth_from = from;
    input.depth = Some(if map.subject_m.is_some() { Depth::Final(map) } else { Depth::Measured(map) });
    Ok(())
}

/// Computes depth from a mask or by networks; returns `None` if neither is requested.
fn compute_depth(command: &RenderCommand, look: &Look, color: &ColorImage) -> Result<Option<Depth>, CliError> {
    let is_given = command.depth_map.is_some() || command.mask.is_some();
    match (&command.mask, &command.blur.depth) {
        (_, DepthChoice::SingleCamera(_) | DepthChoice::Defocus) if is_given => {
            let what = "--depth matte, mono, plate and defocus make the depth themselves: leave --depth-map and --mask \
                        out";
            Err(CliError::Usage(what.to_string()))
        }
        (Some(file), _) => {
            source::reject_metric_look(look, "a mask gives")?;
            let (width, height, share) = still::read_grey(file)?;
            still::check_mask_size(file, (width, height), color.size())?;
            let mask = Mask { width, height, alpha: share };
            plausible::warn_of_mask(file, &mask, color);
            let outline = Outline {
                grow_px: command.mask_grow,
                feather_px: usize::from(command.mask_feather),
                is_exact: look.refine == Refine::Off,
            };
            Ok(Some(Depth::Final(depth_from_mask(&mask, outline, color))))
        }
        (None, DepthChoice::SingleCamera(chosen)) => {
            let map = source::single_camera::compute_picture_depth(chosen, &command.source_options(), look, color)?;
            plausible::warn_of_subject(Some(chosen), &map, command.image.as_deref());
            // Depth with a subject includes its matte; other depth has soft outlines and is refined.
            Ok(Some(if map.subject_m.is_some() { Depth::Final(map) } else { Depth::Measured(map) }))
        }
        (None, DepthChoice::Defocus) => {
            source::reject_metric_look(look, "defocus gives")?;
            defocus::estimate_depth(color).map(Depth::Final).map(Some).ok_or_else(|| {
                let what = "--depth defocus: the picture is equally sharp all over, or has hardly any edges, so its \
                            depth cannot be estimated; use --depth mono or --effect blur";
                CliError::Usage(what.to_string())
            })
        }
        _ => Ok(None),
    }
}

/// Reads the depth map `file` for the picture `color`, and says what was assumed.
///
/// # Errors
/// The file cannot be read, or the look needs metres and its distances are only relative.
fn read_depth(
    file: &Path,
    command: &RenderCommand,
    look: &Look,
    color: &ColorImage,
) -> Result<(DepthMap, DepthOrigin), CliError> {
    let DepthFile { map, distances, notes } = photo::read_depth_file(file, &command.depth, color.size())?;
    let origin = DepthOrigin::from(distances);
    if origin.is_relative() {
        let hint = match command.depth.depth_unit {
            Some(DepthUnit::Inverse) => "",
            _ => " (disparity becomes metres by `depth --metres`)",
        };
        source::reject_metric_look(look, &format!("{} has relative depth{hint}, which gives", file.display()))?;
    }
    notes.iter().for_each(|note| log::note(&format!("{}: {note}", file.display())));
    Ok((map, origin))
}
