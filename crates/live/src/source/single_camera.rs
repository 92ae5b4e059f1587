//! Depth from the pictures of a single camera: networks, and background subtraction with a clean plate.

use std::path::Path;
use std::sync::Arc;

use super::{
    DepthOrigin, OpenRequest, Options, PlateFile, SingleCameraDepth, Source, SourceError, SourceName, cameras, devices,
    networks,
};
use bokehcam::depth::plate::{CameraLock, Guide, PlateDepth, Step};
use bokehcam::depth::{DepthError, DepthSource, FrameInput};
use bokehcam::frame::{ColorImage, DepthMap, Stamp};
use bokehcam::look::Look;
use bokehcam_media::recording::still;

/// Adds the depth of `chosen` to `source`.
///
/// # Errors
/// A file is unreadable or of another size, the source is not live, so that no plate can be taken, or a network cannot be
/// used.
pub(super) fn add_depth(
    source: Source,
    chosen: &SingleCameraDepth,
    name: &SourceName,
    request: &OpenRequest,
) -> Result<Source, SourceError> {
    let info = source.camera.info();
    let networks = chosen.has_networks().then(|| networks::open_networks(chosen, request)).transpose()?;
    let (companion, about) = networks.unzip();
    let plate = match &chosen.plate {
        None => {
            let depth = companion.map(|networks| networks as Box<dyn DepthSource>);
            return Ok(Source { depth, depth_from: DepthOrigin::Networks, networks: about, ..source });
        }
        Some(PlateFile::At(file)) => Some(read_plate(file, info.size)?),
        Some(PlateFile::Taken) if info.live => None,
        Some(PlateFile::Taken) => {
            return SourceError::usage_error(format!(
                "--depth plate: nobody in {name} can step aside; give a picture of the background: --depth \
                 plate:FILE.png (`bokehcam plate` makes one)"
            ));
        }
    };
    let plate_depth = PlateDepth::new(plate, create_lock(name), companion);
    let guide = Some(plate_depth.guide());
    let depth: Option<Box<dyn DepthSource>> = Some(Box::new(plate_depth));
    let depth_from = if about.is_some() { DepthOrigin::Networks } else { DepthOrigin::Plate };
    Ok(Source { depth, depth_from, networks: about, guide, ..source })
}

/// Computes the depth of a single picture with `chosen`.
///
/// # Errors
/// Same as for a source; or the computation fails, or the plate does not match the picture.
pub fn compute_picture_depth(
    chosen: &SingleCameraDepth,
    options: &Options,
    look: &Look,
    color: &ColorImage,
) -> Result<DepthMap, SourceError> {
    let request = OpenRequest { options, look: Some(look), photo: None };
    let seen = FrameInput { stamp: Stamp { index: 0, time_ns: 0, captured_ns: None }, color, right: None };
    let networks = chosen
        .has_networks()
        .then(|| networks::open_networks(chosen, &request))
        .transpose()?
        .map(|(networks, _)| networks);
    let mut map = DepthMap::default();
    match (&chosen.plate, networks) {
        (None, Some(mut networks)) => networks.read(seen, &mut map)?,
        (Some(PlateFile::At(file)), networks) => {
            let mut source = PlateDepth::new(Some(read_plate(file, color.size())?), None, networks);
            source.read(seen, &mut map)?;
            let step = source.guide().step();
            if step != Step::Ready {
                let (name, why) = (file.display().to_string(), step.to_string());
                return Err(DepthError::Plate { name, why }.into());
            }
        }
        (Some(PlateFile::Taken) | None, _) => {
            return SourceError::usage_error(
                "--depth plate: give the picture of the background: --depth plate:FILE.png",
            );
        }
    }
    Ok(map)
}

fn read_plate(file: &Path, (width, height): (u32, u32)) -> Result<ColorImage, SourceError> {
    let plate = still::read_color(file)?;
    if plate.size() == (width, height) {
        return Ok(plate);
    }
    SourceError::usage_error(format!(
        "--depth plate: {} is {} x {}, and the pictures are {width} x {height}: take a plate of that size (`bokehcam plate`)",
        file.display(),
        plate.width,
        plate.height
    ))
}

/// Returns the function that locks the camera's exposure, white balance and focus while a plate is used.
fn create_lock(name: &SourceName) -> Option<CameraLock> {
    devices::controllable_camera(name).and_then(cameras::create_lock)
}

/// Creates a plate source for the pictures of a camera, with its progress, for a program that only takes a plate.
pub fn create_plate_source(name: &SourceName) -> (PlateDepth, Arc<Guide>) {
    let source = PlateDepth::new(None, create_lock(name), None);
    let guide = source.guide();
    (source, guide)
}
