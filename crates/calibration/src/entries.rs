//! Validates the entries that all formats have: cameras, lenses, rotations, sizes.

use glam::{DMat3, DQuat, DVec2, DVec3};

use super::tree::Value;
use bokehcam::calibration::Distortion;
use bokehcam::calibration::LensFault;
use bokehcam::calibration::{CalibrationError, Fault};

/// Largest deviation of a matrix from a rotation: calibrations are written with few digits.
const ROTATION_TOLERANCE: f64 = 1e-3;
/// Upper limit of a baseline, in any unit.
const MAX_BASELINE: f64 = 1e5;
/// Plausible focal lengths in pixels.
const FOCALS_PX: std::ops::Range<f64> = 1.0..1e6;

fn impossible_value(value: Value<'_>, what: &'static str) -> CalibrationError {
    value.to_error(Fault::Impossible { key: value.key(), what })
}

/// Returns focal lengths and principal point in pixels; fails if they are implausible.
pub(super) fn parse_pinhole(value: Value<'_>, [fu, fv, cu, cv]: [f64; 4]) -> Result<(DVec2, DVec2), CalibrationError> {
    if ![fu, fv].iter().all(|focal_px| FOCALS_PX.contains(focal_px)) {
        return Err(impossible_value(value, "has a focal length that is not between 1 and a million pixels"));
    }
    if ![cu, cv].iter().all(|center_px| center_px.abs() < 1e5) {
        return Err(impossible_value(value, "has a principal point far outside the picture"));
    }
    Ok((DVec2::new(fu, fv), DVec2::new(cu, cv)))
}

/// Like [`parse_pinhole`], from a 3x3 camera matrix.
pub(super) fn parse_camera_matrix(value: Value<'_>) -> Result<(DVec2, DVec2), CalibrationError> {
    let [fu, skew, cu, zero, fv, cv, below @ ..] = value.parse_numbers::<9>(3, "3x3")?;
    if skew != 0.0 || zero != 0.0 || below != [0.0, 0.0, 1.0] {
        return Err(impossible_value(value, "is not of the form [fx 0 cx; 0 fy cy; 0 0 1]"));
    }
    parse_pinhole(value, [fu, fv, cu, cv])
}

/// Returns the distortion with the coefficients `value`, of the lens model `model`, by default radial-tangential.
pub(super) fn parse_distortion(model: Option<Value<'_>>, value: Value<'_>) -> Result<Distortion, CalibrationError> {
    let name = model.map(|model| model.text()).transpose()?.unwrap_or("radial-tangential");
    let matrix = value.parse_matrix()?;
    let is_vector = matrix.rows == 1 || matrix.cols == 1 || matrix.data.is_empty();
    let wrong_size = |expected| {
        let found = (matrix.rows, matrix.cols);
        value.to_error(Fault::Dimensions { key: value.key(), found, expected })
    };
    match Distortion::from_model(name, &matrix.data) {
        Ok(_) if !is_vector => Err(wrong_size("a vector")),
        Ok(distortion) => Ok(distortion),
        Err(LensFault::Count(expected)) => Err(wrong_size(expected)),
        Err(LensFault::Tilt) => Err(impossible_value(value, "has a sensor that is tilted by more than 0.5 radians")),
        Err(LensFault::Model) => {
            let model = model.unwrap_or(value);
            let known = "radial-tangential, equidistant or none";
            Err(model.to_error(Fault::Model { key: model.key(), found: name.into(), known }))
        }
    }
}

/// Returns the rotation closest to nine numbers, row by row, which may have rounding errors.
pub(super) fn parse_rotation(value: Value<'_>, rows: &[f64; 9]) -> Result<DMat3, CalibrationError> {
    let matrix = DMat3::from_cols_array(rows).transpose();
    let deviation = matrix * matrix.transpose() - DMat3::IDENTITY;
    if deviation.to_cols_array().iter().any(|part| part.abs() > ROTATION_TOLERANCE) || matrix.determinant() < 0.0 {
        return Err(impossible_value(value, "is not a rotation (rows of length 1, at right angles, right-handed)"));
    }
    Ok(DMat3::from_quat(DQuat::from_mat3(&matrix).normalize()))
}

/// Returns a pose `x -> rotation x + translation` from a 4x4 matrix.
pub(super) fn parse_pose(value: Value<'_>) -> Result<(DMat3, DVec3), CalibrationError> {
    let m = value.parse_numbers::<16>(4, "4x4")?;
    if m[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err(impossible_value(value, "does not end with the row 0 0 0 1"));
    }
    let rotation = parse_rotation(value, &[m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]])?;
    Ok((rotation, DVec3::new(m[3], m[7], m[11])))
}

/// Returns columns and rows of pictures.
pub(super) fn parse_size(value: Value<'_>) -> Result<(u32, u32), CalibrationError> {
    let [width, height] = value.parse_numbers::<2>(2, "a width and a height")?;
    Ok((parse_side(value, width)?, parse_side(value, height)?))
}

/// Returns columns or rows of pictures.
pub(super) fn parse_side(value: Value<'_>, number: f64) -> Result<u32, CalibrationError> {
    if number.fract() != 0.0 || !(1.0..65536.0).contains(&number) {
        return Err(impossible_value(value, "is not a picture size in whole pixels"));
    }
    Ok(number as u32)
}

/// Returns the `translation` between the cameras; fails if its length is no baseline.
pub(super) fn require_baseline(value: Value<'_>, translation: DVec3) -> Result<DVec3, CalibrationError> {
    match translation.length() {
        length if length < 1e-9 => {
            Err(impossible_value(value, "puts both cameras in the same place (a baseline of 0)"))
        }
        length if length < MAX_BASELINE => Ok(translation),
        _ => Err(impossible_value(value, "puts the cameras more than 100000 units apart")),
    }
}
