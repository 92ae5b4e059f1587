//! Depth from one camera that stands still: who stands before a picture of what is behind them.

use std::path::Path;
use std::sync::Arc;

use super::{Source, SourceError, SourceName, Wanted, refuse_metres};
use crate::depth::plate::{Guide, Lock, PlateDepth, Step};
use crate::depth::{DepthError, DepthSource, Seen};
use crate::frame::{ColorImage, DepthMap, Stamp};
use crate::recording::still;

/// The plate of `file`, or one that is to be taken from the first pictures, for the pictures of `source`.
///
/// # Errors
/// The file cannot be read or is of another size, the source cannot be asked to step aside, or the look needs real
/// distances.
pub(super) fn open(
    file: Option<&Path>,
    source: &Source,
    name: &SourceName,
    wanted: &Wanted,
) -> Result<PlateDepth, SourceError> {
    wanted.look.map_or(Ok(()), |look| refuse_metres(look, "a plate tells"))?;
    let info = source.camera.info();
    let plate = match file {
        Some(file) => Some(read(file, info.size)?),
        None if info.live => None,
        None => {
            return SourceError::usage(format!(
                "--depth plate: nobody in {name} can be asked to step aside; name a picture of what is behind them: --depth \
                 plate:FILE.png (`bokehcam plate` makes one)"
            ));
        }
    };
    Ok(PlateDepth::new(plate, lock(name)))
}

/// The depth of one picture, from the plate in `file`.
///
/// # Errors
/// The file cannot be read, is of another size, or is no plate of this picture.
pub fn depth_of_picture(file: &Path, color: &ColorImage) -> Result<DepthMap, SourceError> {
    let mut source = PlateDepth::new(Some(read(file, color.size())?), None);
    let mut map = DepthMap::default();
    source.read(Seen { stamp: Stamp { index: 0, time_ns: 0, captured_ns: None }, color, right: None }, &mut map)?;
    match source.guide().step() {
        Step::Ready => Ok(map),
        step => Err(DepthError::Plate { name: file.display().to_string(), why: step.to_string() }.into()),
    }
}

fn read(file: &Path, (width, height): (u32, u32)) -> Result<ColorImage, SourceError> {
    let plate = still::read_color(file)?;
    if plate.size() == (width, height) {
        return Ok(plate);
    }
    SourceError::usage(format!(
        "--depth plate: {} is {} x {}, and the pictures are {width} x {height}: take a plate of that size (`bokehcam plate`)",
        file.display(),
        plate.width,
        plate.height
    ))
}

/// What holds the camera's exposure, white balance and focus while a plate is used.
pub(super) fn lock(name: &SourceName) -> Option<Lock> {
    #[cfg(feature = "camera")]
    if let Some(camera) = super::devices::camera_of(name) {
        use crate::v4l2::live::hold::Held;
        return Some(Box::new(move || match Held::new(&camera) {
            Ok(held) => Some(Box::new(held)),
            Err(error) => {
                tracing::warn!(
                    "{error}: its exposure may change, and the plate is corrected for that as well as can be"
                );
                None
            }
        }));
    }
    let _ = name;
    None
}

/// A plate source for the pictures of a camera, and how far it is: for a program that takes a plate and no more.
pub fn taking(name: &SourceName) -> (PlateDepth, Arc<Guide>) {
    let source = PlateDepth::new(None, lock(name));
    let guide = source.guide();
    (source, guide)
}
