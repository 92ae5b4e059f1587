//! Input of `render`: the picture, and its depth, which is given, computed, or found in the photo.

use std::path::Path;

use super::RenderCommand;
use crate::error::CliError;
use crate::options;
use crate::plausible;
use bokehcam::depth::defocus;
use bokehcam::depth::matting::mask::{Outline, depth_from_mask};
use bokehcam::engine::still::Depth;
use bokehcam::frame::{ColorImage, DepthMap, Mask};
use bokehcam::look::{Look, Refine};
use bokehcam::optics::StereoRig;
use bokehcam::recording::still::{self, MapFormat};
use bokehcam::recording::{PhotoMetadata, snapshot};
use bokehcam::source::options::DepthUnit;
use bokehcam::source::photo::{self, PhotoDepth};
use bokehcam::source::{self, DepthChoice, DepthOrigin};

/// Input of the blur.
pub(super) struct Input {
    pub color: ColorImage,
    pub metadata: PhotoMetadata,
    pub depth: Option<Depth>,
    /// Origin of depth that was found in or beside the photo.
    pub found: Option<FoundDepth>,
}

/// Origin of depth that the photo brings without an option for it.
pub(super) struct FoundDepth {
    pub from: DepthOrigin,
    pub measured: bool,
    pub by: String,
}

/// Reads the picture, its metadata, and its depth, if any. Inputs not named in the command come from the snapshot of
/// `--like`; its depth is already refined and is not refined again.
pub(super) fn read_input(command: &RenderCommand, look: &Look) -> Result<Input, CliError> {
    let sources = command.like.as_ref().map(|like| snapshot::source_paths(like));
    let given =
        command.depth_map.as_deref().map(|file| read_depth(file, command, look)).transpose()?.map(Depth::Measured);
    let mut found = None;
    let (color, metadata, depth) = match (&command.image, sources) {
        (None, Some((color, depth))) => {
            let is_used = given.is_none() && depth.exists();
            let kept = is_used.then(|| read_depth(&depth, command, look)).transpose()?.map(Depth::Final);
            let (color, metadata) = still::read_photo(&color)?;
            (color, metadata, given.or(kept))
        }
        (image, _) => {
            // clap requires an image without `--like`.
            let image = image.as_deref().unwrap_or(Path::new(""));
            let searches_depth = given.is_none() && command.mask.is_none();
            let is_automatic = matches!(command.blur.depth, DepthChoice::Auto | DepthChoice::Recorded);
            let searches_depth = searches_depth && is_automatic;
            // A snapshot stands for the picture that it was made from.
            let image = if searches_depth { photo::original_path(image) } else { image.to_owned() };
            let (color, metadata) = still::read_photo(&image)?;
            let is_wanted = searches_depth && look.effect.follows_depth();
            let depth = if is_wanted {
                photo::read_default_depth(&image, &color, &command.source_options(), look)?
            } else {
                None
            };
            let depth = depth.map(|PhotoDepth { map, from, measured, by }| {
                if from == DepthOrigin::Networks {
                    plausible::warn_of_subject(None, &map, None);
                }
                found = Some(FoundDepth { from, measured, by });
                if map.subject_m.is_some() { Depth::Final(map) } else { Depth::Measured(map) }
            });
            (color, metadata, given.or(depth))
        }
    };
    let mut depth = depth;
    if let (Some(Depth::Measured(map)), Some(file)) = (&mut depth, &command.depth_map) {
        still::check_depth_size(file, map.size(), color.size())?;
        source::find_person(&command.source_options(), look, &color, map);
    }
    let made = compute_depth(command, look, &color)?;
    Ok(Input { color, metadata, depth: made.or(depth), found })
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

/// Reads relative inverse depth as distances, in units of the nearest distance.
fn read_inverse_depth(file: &Path, invert: bool) -> Result<DepthMap, CliError> {
    let (width, height, mut nearness) = match still::map_format(file) {
        Ok(MapFormat::Pfm) => match still::read_map(file, None, None)? {
            still::Map::Depth(map) => (map.width, map.height, map.metres),
            still::Map::Disparity(map, _) => (map.width, map.height, map.px),
        },
        _ => still::read_grey(file)?,
    };
    let known = nearness.iter().copied().filter(|value| value.is_finite());
    let (low, high) = known.fold((f32::MAX, f32::MIN), |(low, high), value| (low.min(value), high.max(value)));
    let scale = 1.0 / (high - low).max(f32::MIN_POSITIVE);
    for value in &mut nearness {
        let near = (*value - low) * scale;
        let near = if invert { 1.0 - near } else { near };
        *value = if near.is_finite() { DepthMap::relative_to_metres(near) } else { 0.0 };
    }
    Ok(DepthMap { width, height, metres: nearness, ..DepthMap::default() })
}

/// Reads depth in metres from a file of depth or disparity. Disparity without stereo geometry gives depth of unknown
/// scale, which is an error if the look needs metres.
fn read_depth(file: &Path, command: &RenderCommand, look: &Look) -> Result<DepthMap, CliError> {
    let name = file.display();
    if command.depth.depth_unit == DepthUnit::Inverse {
        source::reject_metric_look(look, source::INVERSE_DEPTH_GIVES)?;
        return read_inverse_depth(file, command.depth.depth_invert);
    }
    let options::Depth { depth_scale, depth_invalid, .. } = command.depth;
    let (map, rig) = match still::read_map(file, depth_scale, Some(depth_invalid))? {
        still::Map::Depth(map) => return Ok(map),
        still::Map::Disparity(map, rig) => (map, rig),
    };
    if depth_scale.is_some() {
        tracing::warn!("{name}: contains disparity; --depth-scale does not apply to it");
    }
    let rig = match (rig, look.metric_setting()) {
        (Some(rig), _) => rig,
        (None, None) => {
            tracing::warn!(
                "{name}: contains disparity without a scale: the order of depth is known, distances are \
                            not"
            );
            StereoRig::default_for_width(map.width)
        }
        (None, Some(needs)) => {
            return Err(CliError::Usage(format!(
                "{needs} needs distances, and {name} contains disparity without a scale: write it with `depth \
                 --metres`, or use --focus auto or X,Y, and --blur"
            )));
        }
    };
    Ok(map.to_depth_map(|px| rig.depth_m(px)))
}
