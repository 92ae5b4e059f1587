//! Reads Kalibr's camchain: `cam0` and `cam1` with the pose between them (P. Furgale et al., *Unified temporal and
//! spatial calibration for multi-sensor systems*, IROS 2013); the keys are those of Kalibr's page "YAML formats".

use glam::{DMat3, DVec3};

use super::entries;
use super::euroc::require_pinhole;
use super::tree::{File, Value};
use bokehcam::calibration::CalibrationError;
use bokehcam::calibration::{CameraIntrinsics, LengthUnit, StereoCalibration};

/// Remedy for a missing key.
const HINT: &str = "name the camchain that kalibr_calibrate_cameras wrote for both cameras";

/// Reads the first two cameras of a chain.
pub(super) fn from_file(file: &File) -> Result<StereoCalibration, CalibrationError> {
    let cameras = [file.root().require("cam0", HINT)?, file.root().require("cam1", HINT)?];
    let (pose, (rotation, translation_m)) = read_pose(cameras)?;
    Ok(StereoCalibration {
        cameras: [read_camera(cameras[0])?, read_camera(cameras[1])?],
        rotation,
        translation_m: entries::require_baseline(pose, translation_m)?,
        stored_rectification: None,
        unit: LengthUnit::Stated,
    })
}

/// Reads the pose from the axes of cam0 ("cn minus 1") to those of cam1, and its entry. A calibration with an IMU may
/// have the poses of both from the IMU's axes instead.
fn read_pose([left, right]: [Value<'_>; 2]) -> Result<(Value<'_>, (DMat3, DVec3)), CalibrationError> {
    if right.get("T_cn_cnm1").is_none()
        && let (Some(left), Some(right)) = (left.get("T_cam_imu"), right.get("T_cam_imu"))
    {
        let ((left_rotation, left_m), (right_rotation, right_m)) =
            (entries::parse_pose(left)?, entries::parse_pose(right)?);
        let rotation = right_rotation * left_rotation.transpose();
        return Ok((right, (rotation, right_m - rotation * left_m)));
    }
    let pose = right.require("T_cn_cnm1", HINT)?;
    Ok((pose, entries::parse_pose(pose)?))
}

/// Reads the camera under `cam0` or `cam1`.
fn read_camera(camera: Value<'_>) -> Result<CameraIntrinsics, CalibrationError> {
    require_pinhole(camera)?;
    let intrinsics = camera.require("intrinsics", HINT)?;
    let numbers = intrinsics.parse_numbers::<4>(4, "4 numbers (fu fv pu pv)")?;
    let (focal_px, center_px) = entries::parse_pinhole(intrinsics, numbers)?;
    let coefficients = camera.require("distortion_coeffs", HINT)?;
    Ok(CameraIntrinsics {
        size: camera.get("resolution").map(entries::parse_size).transpose()?,
        focal_px,
        center_px,
        distortion: entries::parse_distortion(camera.get("distortion_model"), coefficients)?,
    })
}
