//! Reads the calibration files of `--calib`: the geometry of a rectified stereo pair, or the calibration of a raw one.

use std::path::{Path, PathBuf};

use super::SourceError;
use crate::calibration::{self, CalibrationError, Fault, StereoCalibration};
use crate::recording::geometry::Geometry;

/// A calibration of two cameras.
pub enum PairCalibration {
    /// Their pictures are rectified: a `calib.txt` of Middlebury, ETH3D or KITTI.
    Rectified {
        /// Their geometry, scaled to the given pictures.
        geometry: Geometry,
        /// Width and height of the pictures that the calibration is for, if stated.
        made_for: Option<(u32, u32)>,
    },
    /// Their pictures are raw; the calibration of OpenCV, Kalibr or EuRoC allows to rectify them.
    Raw(Box<StereoCalibration>),
}

/// Reads a calibration (the content decides its format) for pictures of `size` (columns, rows) in the file or folder
/// `pictures`.
///
/// # Errors
/// The file is of another format, lacks an entry, has invalid numbers, or is for pictures of another aspect ratio.
pub fn read_pair_calibration(
    files: &[PathBuf],
    pictures: &Path,
    size: (u32, u32),
) -> Result<PairCalibration, SourceError> {
    let paths: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    match (calibration::load_calibration(&paths), &paths[..]) {
        (Ok(calibration), _) => Ok(PairCalibration::Raw(Box::new(calibration))),
        // Not recognised and without a YAML extension: try `calib.txt`. A broken `.yml` keeps its own error.
        (Err(error), [file]) if !is_yaml(file) && is_unrecognized(&error) => {
            let stated = Geometry::read(file, pictures)?;
            Ok(PairCalibration::Rectified { geometry: stated.scaled_to(file, size)?, made_for: stated.size })
        }
        (Err(error), _) => Err(error.into()),
    }
}

fn is_yaml(file: &Path) -> bool {
    let extension = file.extension().map(|extension| extension.to_ascii_lowercase());
    extension.is_some_and(|extension| extension == "yml" || extension == "yaml")
}

fn is_unrecognized(error: &CalibrationError) -> bool {
    matches!(
        error,
        CalibrationError::Unknown(_) | CalibrationError::File { fault: Fault::Syntax { format: "YAML", .. }, .. }
    )
}
