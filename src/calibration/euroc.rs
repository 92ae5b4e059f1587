//! Reads the `sensor.yaml` of the EuRoC/ASL layout: one file per camera, with its pose on the body (M. Burri et al.,
//! *The EuRoC micro aerial vehicle datasets*, IJRR 35, 2016).

use std::path::Path;

use glam::{DMat3, DVec3};

use super::error::{CalibrationError, Fault};
use super::yaml::{File, Value};
use super::{Eye, StereoCalibration, entries};

/// Remedy for a missing key.
const HINT: &str = "copy sensor.yaml anew from the recording";

/// Reads the `sensor.yaml` of the left and of the right camera.
///
/// # Errors
/// Fails if a file is unreadable or lacks a key, or if numbers are invalid.
pub fn read(left: &Path, right: &Path) -> Result<StereoCalibration, CalibrationError> {
    from_files(&File::open(left)?, &File::open(right)?)
}

/// Like [`read`], from parsed files.
pub(super) fn from_files(left: &File, right: &File) -> Result<StereoCalibration, CalibrationError> {
    let poses = [body_from_camera(left.root())?, body_from_camera(right.root())?];
    let [(left_rotation, left_place), (right_rotation, right_place)] = poses;
    // Poses map from camera to body: left to right is the left pose, then the inverse of the right one.
    let body_to_right = right_rotation.transpose();
    let right_pose = right.root().require("T_BS", HINT)?;
    Ok(StereoCalibration {
        eyes: [eye(left.root())?, eye(right.root())?],
        rotation: body_to_right * left_rotation,
        translation_m: entries::nonzero(right_pose, body_to_right * (left_place - right_place))?,
        given: None,
        assumed_mm: false,
    })
}

fn body_from_camera(file: Value<'_>) -> Result<(DMat3, DVec3), CalibrationError> {
    entries::pose(file.require("T_BS", HINT)?)
}

/// Reads the camera that `file` describes.
fn eye(file: Value<'_>) -> Result<Eye, CalibrationError> {
    pinhole_only(file)?;
    let intrinsics = file.require("intrinsics", HINT)?;
    let numbers = intrinsics.numbers::<4>(4, "4 numbers (fu fv cu cv)")?;
    let (focal_px, center_px) = entries::pinhole(intrinsics, numbers)?;
    let coefficients = file.require("distortion_coefficients", HINT)?;
    Ok(Eye {
        size: file.get("resolution").map(entries::size).transpose()?,
        focal_px,
        center_px,
        distortion: entries::distortion(file.get("distortion_model"), coefficients)?,
    })
}

/// Refuses camera models other than a pinhole with a lens.
pub(super) fn pinhole_only(camera: Value<'_>) -> Result<(), CalibrationError> {
    match camera.get("camera_model") {
        Some(model) if model.text()? != "pinhole" => {
            Err(model.refuse(Fault::Model { key: model.key(), found: model.text()?.into(), known: "pinhole" }))
        }
        _ => Ok(()),
    }
}
