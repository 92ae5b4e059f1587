//! The rectification that a file contains: rotations to the rectified axes and projections, as of OpenCV's
//! `stereoRectify` and ROS's camera_info.

use glam::{DMat3, DVec2, DVec3};

use super::entries;
use super::tree::Value;
use bokehcam::calibration::rectification::Rectification;
use bokehcam::calibration::{CalibrationError, Fault};
use bokehcam::calibration::{CameraIntrinsics, LengthUnit, StereoCalibration};

/// A 3x4 projection, decomposed.
struct Projection {
    focal_px: DVec2,
    center_px: DVec2,
    /// The fourth column: the focal length times the position of the left camera.
    shift: DVec2,
}

fn parse_projection(value: Value<'_>) -> Result<Projection, CalibrationError> {
    let [fx, _, cx, across, _, fy, cy, down, ..] = value.parse_numbers::<12>(3, "3x4")?;
    let (focal_px, center_px) = entries::parse_pinhole(value, [fx, fy, cx, cy])?;
    Ok(Projection { focal_px, center_px, shift: DVec2::new(across, down) })
}

/// Returns the position of a camera along the rows of its rectified picture, in the file's unit.
pub(super) fn parse_shift(projection: Value<'_>) -> Result<f64, CalibrationError> {
    let Projection { focal_px, shift, .. } = parse_projection(projection)?;
    Ok(shift.x / focal_px.x)
}

/// Returns the rectification of the left and of the right camera, and the position of the left camera along the rows of
/// the right one, both in the file's unit.
pub(super) fn parse_rectification(
    rotations: [Value<'_>; 2],
    projections: [Value<'_>; 2],
) -> Result<(Rectification, f64), CalibrationError> {
    let parse_rotation = |value: Value<'_>| entries::parse_rotation(value, &value.parse_numbers::<9>(3, "3x3")?);
    let rotations = [parse_rotation(rotations[0])?, parse_rotation(rotations[1])?];
    let [left, right] = [parse_projection(projections[0])?, parse_projection(projections[1])?];
    let (focal_px, left_px, right_px) = (left.focal_px, left.center_px, right.center_px);
    let value = projections[1];
    let impossible = |what| value.to_error(Fault::Impossible { key: value.key(), what });
    let shift = right.shift - left.shift;
    if shift.y.abs() > shift.x.abs() {
        return Err(CalibrationError::NotSideBySide("above"));
    }
    // The fourth column is in pixels: focal length times translation.
    let shift = shift.x / focal_px.x;
    entries::require_baseline(value, DVec3::new(shift, 0.0, 0.0))?;
    if (focal_px - right.focal_px).abs().max_element() > 1e-3 * focal_px.x || (left_px.y - right_px.y).abs() > 0.01 {
        return Err(impossible(
            "is not the partner of P1 in a rectified pair: focal lengths and rows must be the same",
        ));
    }
    let centers_px = [left_px, right_px];
    Ok((Rectification { rotations, focal_px, centers_px, baseline_m: shift.abs() }, shift))
}

/// Returns the pose of the right camera: from the left camera to the rectified axes, and on to the right one.
pub(super) fn find_pose(given: &Rectification, shift: f64) -> (DMat3, DVec3) {
    let rectified_to_right = given.rotations[1].transpose();
    (rectified_to_right * given.rotations[0], rectified_to_right * DVec3::new(shift, 0.0, 0.0))
}

/// Returns the calibration of `cameras` whose pose follows from their rectification, in a unit that is assumed.
pub(super) fn from_rectification(
    cameras: [CameraIntrinsics; 2],
    given: Rectification,
    shift: f64,
) -> StereoCalibration {
    let unit = LengthUnit::assume(given.baseline_m);
    let (rotation, translation) = find_pose(&given, shift);
    StereoCalibration {
        cameras,
        rotation,
        translation_m: translation * unit.metres(),
        stored_rectification: Some(Rectification { baseline_m: given.baseline_m * unit.metres(), ..given }),
        unit,
    }
}
