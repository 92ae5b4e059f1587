//! Reads the calibration files of `--calib`: the geometry of a rectified stereo pair, or the calibration of a raw one.

use std::path::{Path, PathBuf};

use super::SourceError;
use bokehcam::calibration::{CalibrationError, Fault, StereoCalibration};
use bokehcam_media::recording::geometry::Geometry;
use bokehcam_media::recording::{GeometryFault, RecordingError};

/// A calibration of two cameras.
pub enum PairCalibration {
    /// Their pictures are rectified: a `calib.txt` of Middlebury, ETH3D or KITTI.
    Rectified {
        /// Their geometry, scaled to the given pictures.
        geometry: Geometry,
        /// Width and height of the pictures that the calibration is for, if stated.
        made_for: Option<(u32, u32)>,
    },
    /// Their pictures are raw, and the calibration allows to rectify them.
    Raw(Box<StereoCalibration>),
}

impl PairCalibration {
    /// Replaces the distance between the cameras, in metres, > 0.
    fn set_baseline_m(&mut self, baseline_m: f32) {
        match self {
            Self::Rectified { geometry, .. } => geometry.rig.baseline_m = baseline_m,
            Self::Raw(calibration) => **calibration = calibration.with_baseline_m(baseline_m.into()),
        }
    }

    /// Returns the distance between the cameras in metres.
    pub fn baseline_m(&self) -> f64 {
        match self {
            Self::Rectified { geometry, .. } => geometry.rig.baseline_m.into(),
            Self::Raw(calibration) => calibration.baseline_m(),
        }
    }
}

/// Reads a calibration (the content decides its format) for pictures of `size` (columns, rows) in the file or folder
/// `pictures`. `baseline_m`, in metres, > 0, replaces the distance between the cameras that it states.
///
/// # Errors
/// The file is of another format, lacks an entry, has invalid numbers, or is for pictures of another aspect ratio.
pub fn read_pair_calibration(
    files: &[PathBuf],
    pictures: &Path,
    size: (u32, u32),
    baseline_m: Option<f32>,
) -> Result<PairCalibration, SourceError> {
    let paths: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    let mut read = match (bokehcam_calibration::load_calibration_for(&paths, Some(size)), &paths[..]) {
        (Ok(calibration), _) => PairCalibration::Raw(Box::new(calibration)),
        // Not recognised and without a YAML extension: try `calib.txt`. A broken `.yml` keeps its own error.
        (Err(error), [file]) if !is_yaml(file) && is_unrecognized(&error) => match Geometry::read(file, pictures) {
            Ok(stated) => PairCalibration::Rectified { geometry: stated.scaled_to(file, size)?, made_for: stated.size },
            Err(RecordingError::Geometry { fault: GeometryFault::Unknown, .. }) => {
                return Err(bokehcam_calibration::formats::unknown_format(file).into());
            }
            Err(error) => return Err(error.into()),
        },
        (Err(error), _) => return Err(error.into()),
    };
    baseline_m.into_iter().for_each(|baseline_m| read.set_baseline_m(baseline_m));
    Ok(read)
}

fn is_yaml(file: &Path) -> bool {
    let extension = file.extension().map(|extension| extension.to_ascii_lowercase());
    extension.is_some_and(|extension| extension == "yml" || extension == "yaml")
}

fn is_unrecognized(error: &CalibrationError) -> bool {
    matches!(
        error,
        CalibrationError::Unknown { .. } | CalibrationError::File { fault: Fault::Syntax { format: "YAML", .. }, .. }
    )
}
