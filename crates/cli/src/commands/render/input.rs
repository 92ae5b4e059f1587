//! Input of `render`: the picture, and its depth, which is given, computed, or found in the photo.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::RenderCommand;
use crate::error::CliError;
use crate::log;
use bokehcam::depth::defocus;
use bokehcam::depth::focus::FocusRule;
use bokehcam::depth::matting::mask::{Outline, depth_from_mask};
use bokehcam::engine::still::Depth;
use bokehcam::frame::{ColorImage, DepthMap, Mask};
use bokehcam::look::{Look, Refine};
use bokehcam_files::place;
use bokehcam_live::source::orientation::transform_photo;
use bokehcam_live::source::photo::{self, PhotoDepth};
use bokehcam_live::source::{self, DepthChoice, DepthOrigin, PlateFile};
use bokehcam_media::recording::depth_file::DepthFile;
use bokehcam_media::recording::mask_file::{self, MaskFile};
use bokehcam_media::recording::{Photo, snapshot};

/// Input of the blur.
pub(super) struct Input {
    pub photo: Photo,
    pub depth: Option<Depth>,
    /// The origin of the depth.
    pub depth_from: DepthOrigin,
    /// Depth that was found in or beside the photo.
    pub found: Option<FoundDepth>,
    /// What was assumed about a depth map, a line each.
    pub notes: Vec<String>,
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
    if command.image.is_none() && !image.exists() {
        return Err(CliError::NoOriginal(image));
    }
    let mut photo = Photo::read(&image)?;
    photo.notes.iter().for_each(|note| log::note(&format!("{}: {note}", image.display())));
    // Maps and masks are of the picture as it is in its file, and are turned and cut with it.
    let own_px = photo.color.size();
    transform_photo(command.orientation, &image.display().to_string(), &mut photo)?;
    let mut input = Input { photo, depth: None, depth_from: DepthOrigin::Nothing, found: None, notes: Vec::new() };
    if let Some((made, from)) = compute_depth(command, look, (&input.photo.color, own_px))? {
        (input.depth, input.depth_from) = (Some(made), from);
    } else if let Some(file) = &command.depth_map {
        let (mut map, from) = read_depth(file, command, own_px, &mut input.notes)?;
        source::find_person(&command.source_options(), look, &input.photo.color, &mut map);
        (input.depth, input.depth_from) = (Some(Depth::Measured(map)), from);
    } else if let Some(file) = kept_depth {
        let (map, from) = read_depth(&file, command, own_px, &mut input.notes)?;
        (input.depth, input.depth_from) = (Some(Depth::Final(map)), from);
    } else if command.image.is_some() && searches_depth && look.effect.follows_depth() {
        find_depth(&image, command, look, &mut input)?;
    }
    let is_itself = |file: &&PathBuf| place::resolve_links(file) == place::resolve_links(&image);
    // A cut-out is its own mask.
    if let Some(file) = command.depth_map.as_ref().or(command.mask.as_ref()).filter(is_itself)
        && input.photo.alpha.is_none()
    {
        log::warn(&format!("{}: this is the picture itself, not its depth or mask", file.display()));
    }
    Ok(input)
}

/// Finds the depth of a photo as a stream of it does: beside it, or by an installed network.
fn find_depth(image: &Path, command: &RenderCommand, look: &Look, input: &mut Input) -> Result<(), CliError> {
    let color = Arc::new(std::mem::take(&mut input.photo.color));
    let (found, notes) = photo::read_default_depth(image, &color, &command.source_options(), look)?;
    input.photo.color = Arc::unwrap_or_clone(color);
    notes.iter().for_each(|note| log::note(note));
    let Some(PhotoDepth { map, from, measured, by, original, focus }) = found else { return Ok(()) };
    if from == DepthOrigin::Networks {
        warn_of_nobody(None, &map);
    }
    input.found = Some(FoundDepth { measured, by, focus });
    original.into_iter().for_each(|original| input.photo.replace_by_original(original));
    input.depth_from = from;
    input.depth = Some(if map.subject_m.is_some() { Depth::Final(map) } else { Depth::Measured(map) });
    Ok(())
}

/// Computes depth from a mask, by networks or from defocus, with its origin: its distances are relative. Returns `None` if
/// none is requested. `own_px` is the size of the picture in its file.
fn compute_depth(
    command: &RenderCommand,
    look: &Look,
    (color, own_px): (&ColorImage, (u32, u32)),
) -> Result<Option<(Depth, DepthOrigin)>, CliError> {
    let is_given = command.depth_map.is_some() || command.mask.is_some();
    match (&command.mask, &command.blur.depth) {
        (_, DepthChoice::SingleCamera(_) | DepthChoice::Defocus) if is_given => {
            let what = "--depth matte, mono, plate and defocus make the depth themselves: leave --depth-map and --mask \
                        out";
            Err(CliError::Usage(what.to_string()))
        }
        (Some(file), _) => {
            let MaskFile { mask, notes } = mask_file::read(file, own_px)?;
            notes.iter().for_each(|note| log::note(&format!("{}: {note}", file.display())));
            let mask = command.orientation.transform().apply_to_mask(&mask, own_px);
            warn_of_flat_mask(file, &mask);
            let outline = Outline {
                grow_px: command.mask_grow,
                feather_px: usize::from(command.mask_feather),
                is_exact: look.refine == Refine::Off,
            };
            Ok(Some((Depth::Final(depth_from_mask(&mask, outline, color)), DepthOrigin::Relative)))
        }
        (None, DepthChoice::SingleCamera(chosen)) => {
            let map = source::single_camera::compute_picture_depth(chosen, &command.source_options(), look, color)?;
            warn_of_nobody(chosen.plate.as_ref(), &map);
            // Depth with a subject includes its matte; other depth has soft outlines and is refined.
            let depth = if map.subject_m.is_some() { Depth::Final(map) } else { Depth::Measured(map) };
            Ok(Some((depth, DepthOrigin::Networks)))
        }
        (None, DepthChoice::Defocus) => {
            let Some(map) = defocus::estimate_depth(color) else {
                let what = "--depth defocus: the picture is equally sharp all over, or has hardly any edges, so its \
                            depth cannot be estimated; use --depth mono or --effect blur";
                return Err(CliError::Usage(what.to_string()));
            };
            Ok(Some((Depth::Final(map), DepthOrigin::Relative)))
        }
        _ => Ok(None),
    }
}

/// Reads the depth map `file` for a picture that is `own_px` large in its file, and notes what was assumed.
///
/// # Errors
/// The file cannot be read.
fn read_depth(
    file: &Path,
    command: &RenderCommand,
    own_px: (u32, u32),
    notes: &mut Vec<String>,
) -> Result<(DepthMap, DepthOrigin), CliError> {
    let DepthFile { map, distances, notes: assumed } = photo::read_depth_file(file, &command.depth, own_px)?;
    notes.extend(assumed.iter().map(|note| format!("{}: {note}", file.display())));
    Ok((command.orientation.transform().transform_map(map, own_px), distances.into()))
}

/// Warns of a mask that separates nothing.
fn warn_of_flat_mask(file: &Path, mask: &Mask) {
    let value = mask.alpha.first().copied().unwrap_or_default();
    if mask.alpha.iter().all(|alpha| (alpha - value).abs() < 0.02) {
        log::warn(&format!(
            "{}: the mask is {value:.1} all over, from 0 (blurred) to 1 (sharp): it separates no subject from the background",
            file.display()
        ));
    }
}

/// Warns if no person is in front of the plate, or found by networks.
fn warn_of_nobody(plate: Option<&PlateFile>, map: &DepthMap) {
    let is_near = |subject_m: f32| map.metres.iter().any(|&metres| metres <= subject_m);
    match (map.subject_m, plate) {
        (None, _) => {}
        (Some(subject_m), _) if is_near(subject_m) => {}
        (_, Some(PlateFile::At(plate))) => log::warn(&format!(
            "{}: nothing in the picture differs from the plate, so everything is blurred; a plate shows the place \
             without the person",
            plate.display()
        )),
        _ => log::warn("no person was found in the picture, so everything is blurred"),
    }
}
