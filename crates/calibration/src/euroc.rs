//! Reads the `sensor.yaml` of the EuRoC/ASL layout: one file per camera, with its pose on the body (M. Burri et al.,
//! *The EuRoC micro aerial vehicle datasets*, IJRR 35, 2016).

use std::path::Path;

use glam::{DMat3, DVec3};

use super::entries;
use super::tree::{File, Value};
use bokehcam::calibration::{CalibrationError, Fault};
use bokehcam::calibration::{CameraIntrinsics, LengthUnit, StereoCalibration};

/// Remedy for a missing key.
const HINT: &str = "copy sensor.yaml from the recording again";

/// Reads the `sensor.yaml` of the left and of the right camera.
///
/// # Errors
/// Fails if a file is unreadable or lacks a key, or if numbers are invalid.
pub fn read_sensors(left: &Path, right: &Path) -> Result<StereoCalibration, CalibrationError> {
    from_files(&File::open(left)?, &File::open(right)?)
}

/// Like [`read_sensors`], from parsed files.
pub(super) fn from_files(left: &File, right: &File) -> Result<StereoCalibration, CalibrationError> {
    let poses = [read_body_from_camera(left.root())?, read_body_from_camera(right.root())?];
    let [(left_rotation, left_place), (right_rotation, right_place)] = poses;
    // Poses map from camera to body: left to right is the left pose, then the inverse of the right one.
    let body_to_right = right_rotation.transpose();
    let right_pose = right.root().require("T_BS", HINT)?;
    Ok(StereoCalibration {
        cameras: [read_camera(left.root())?, read_camera(right.root())?],
        rotation: body_to_right * left_rotation,
        translation_m: entries::require_baseline(right_pose, body_to_right * (left_place - right_place))?,
        stored_rectification: None,
        unit: LengthUnit::Stated,
    })
}

fn read_body_from_camera(file: Value<'_>) -> Result<(DMat3, DVec3), CalibrationError> {
    entries::parse_pose(file.require("T_BS", HINT)?)
}

/// Reads the camera that `file` describes.
fn read_camera(file: Value<'_>) -> Result<CameraIntrinsics, CalibrationError> {
    require_pinhole(file)?;
    let intrinsics = file.require("intrinsics", HINT)?;
    let numbers = intrinsics.parse_numbers::<4>(4, "4 numbers (fu fv cu cv)")?;
    let (focal_px, center_px) = entries::parse_pinhole(intrinsics, numbers)?;
    let coefficients = file.require("distortion_coefficients", HINT)?;
    Ok(CameraIntrinsics {
        size: file.get("resolution").map(entries::parse_size).transpose()?,
        focal_px,
        center_px,
        distortion: entries::parse_distortion(file.get("distortion_model"), coefficients)?,
    })
}

/// The models that are read, and how to get one of them.
const MODELS: &str = "pinhole: calibrate again with pinhole-radtan, or with pinhole-equi for a fisheye";

/// Refuses camera models other than a pinhole with a lens.
pub(super) fn require_pinhole(camera: Value<'_>) -> Result<(), CalibrationError> {
    match camera.get("camera_model") {
        Some(model) if model.text()? != "pinhole" => {
            Err(model.to_error(Fault::Model { key: model.key(), found: model.text()?.into(), known: MODELS }))
        }
        _ => Ok(()),
    }
}
