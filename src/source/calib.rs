//! The calibration files of `--calib`: the geometry of an already rectified stereo pair, or how to rectify a raw one.

use std::path::{Path, PathBuf};

use super::SourceError;
use crate::calibration::{self, CalibrationError, Fault, StereoCalibration};
use crate::recording::geometry::Geometry;

/// What a calibration says of two eyes.
pub enum Eyes {
    /// Their pictures are rectified: a `calib.txt` of Middlebury, ETH3D or KITTI.
    Rectified {
        /// Their geometry, scaled to the pictures at hand.
        geometry: Geometry,
        /// Columns and rows of the pictures that the calibration was made for, where the file says so.
        made_for: Option<(u32, u32)>,
    },
    /// Their pictures are raw, and this tells how to rectify them: OpenCV's, Kalibr's or EuRoC's.
    Raw(Box<StereoCalibration>),
}

/// Reads a calibration, recognised by content, for pictures of `size` (columns, rows) in the file or folder `pictures`.
///
/// # Errors
/// It is of another kind, lacks an entry, has numbers that cannot be, or is for pictures of another aspect.
pub fn read(files: &[PathBuf], pictures: &Path, size: (u32, u32)) -> Result<Eyes, SourceError> {
    let paths: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    match (calibration::load(&paths), &paths[..]) {
        (Ok(calibration), _) => Ok(Eyes::Raw(Box::new(calibration))),
        // Not recognised, and not named as YAML: perhaps a `calib.txt`. A broken `.yml` keeps its own error.
        (Err(error), [file]) if !is_yaml(file) && is_of_another_kind(&error) => {
            let stated = Geometry::read(file, pictures)?;
            Ok(Eyes::Rectified { geometry: stated.fitted(file, size)?, made_for: stated.size })
        }
        (Err(error), _) => Err(error.into()),
    }
}

fn is_yaml(file: &Path) -> bool {
    let extension = file.extension().map(|extension| extension.to_ascii_lowercase());
    extension.is_some_and(|extension| extension == "yml" || extension == "yaml")
}

fn is_of_another_kind(error: &CalibrationError) -> bool {
    matches!(error, CalibrationError::Unknown(_) | CalibrationError::File { fault: Fault::Yaml(_), .. })
}
