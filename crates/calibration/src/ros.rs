//! Reads ROS's camera_info of both cameras: the files that `camera_calibration` writes, and printed messages of
//! `sensor_msgs/CameraInfo`, whose entries are K D R P. R and P rectify; the fourth column of P has the baseline (REP
//! 104 and the message's definition).

use super::tree::{File, Value};
use super::{entries, stored};
use bokehcam::calibration::CalibrationError;
use bokehcam::calibration::{CameraIntrinsics, StereoCalibration};

/// Remedy for a missing key.
const HINT: &str = "copy the camera_info of the calibrated stereo pair again";

/// Names of the entries: in files, in messages of ROS 1 and of ROS 2.
const CAMERA: [&str; 3] = ["camera_matrix", "K", "k"];
const LENS: [&str; 3] = ["distortion_coefficients", "D", "d"];
const ROTATION: [&str; 3] = ["rectification_matrix", "R", "r"];
const PROJECTION: [&str; 3] = ["projection_matrix", "P", "p"];

fn find_entry<'a>(file: &'a File, names: [&str; 3]) -> Option<Value<'a>> {
    names.iter().find_map(|name| file.root().get(name))
}

fn require_entry<'a>(file: &'a File, names: [&'static str; 3]) -> Result<Value<'a>, CalibrationError> {
    find_entry(file, names).map_or_else(|| file.root().require(names[0], HINT), Ok)
}

/// Whether the file has entries of this format.
pub(super) fn is_camera_info(file: &File) -> bool {
    find_entry(file, CAMERA).is_some() && find_entry(file, PROJECTION).is_some()
}

/// Reads the camera_info of the left and of the right camera, in any order: the left camera is the reference, without a
/// translation in its projection.
pub(super) fn from_files(one: &File, other: &File) -> Result<StereoCalibration, CalibrationError> {
    let shift = |file| stored::parse_shift(require_entry(file, PROJECTION)?);
    let (left, right) = if shift(one)? < shift(other)? { (other, one) } else { (one, other) };
    let cameras = [read_camera(left)?, read_camera(right)?];
    let rotations = [require_entry(left, ROTATION)?, require_entry(right, ROTATION)?];
    let projections = [require_entry(left, PROJECTION)?, require_entry(right, PROJECTION)?];
    let (given, shift) = stored::parse_rectification(rotations, projections)?;
    Ok(stored::from_rectification(cameras, given, shift))
}

fn read_camera(file: &File) -> Result<CameraIntrinsics, CalibrationError> {
    let (focal_px, center_px) = entries::parse_camera_matrix(require_entry(file, CAMERA)?)?;
    let side = |names: [&str; 2]| {
        let value = names.iter().find_map(|name| file.root().get(name));
        value.map(|value| entries::parse_side(value, value.parse_count()?.into())).transpose()
    };
    Ok(CameraIntrinsics {
        size: side(["image_width", "width"])?.zip(side(["image_height", "height"])?),
        focal_px,
        center_px,
        distortion: entries::parse_distortion(file.root().get("distortion_model"), require_entry(file, LENS)?)?,
    })
}
