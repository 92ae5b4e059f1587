//! Reads the calibration in the settings of ORB-SLAM: cameras and lenses as `Camera1.fx` and so on with the pose
//! `Stereo.T_c1_c2` (ORB_SLAM3's `Calibration_Tutorial.pdf`) or `Tlr`, or a rectified pair with `Camera.bf` or
//! `Stereo.b`. The pair LEFT.K RIGHT.K is read as OpenCV's.

use glam::{DMat3, DVec2, DVec3};

use super::error::{CalibrationError, Fault};
use super::rectification::Rectification;
use super::tree::{File, Value};
use super::{CameraIntrinsics, Distortion, LengthUnit, StereoCalibration, entries};

/// Remedy for a missing key.
const HINT: &str = "name the settings of a stereo camera";

/// Whether the file has entries of this format.
pub(super) fn is_settings(file: &File) -> bool {
    ["Camera1.fx", "Camera.fx"].iter().any(|key| file.root().get(key).is_some())
}

/// Reads the calibration in a settings file.
pub(super) fn from_file(file: &File) -> Result<StereoCalibration, CalibrationError> {
    let root = file.root();
    let left = if root.get("Camera1.fx").is_some() { "Camera1" } else { "Camera" };
    match ["Stereo.T_c1_c2", "Tlr"].iter().find_map(|key| root.get(key)) {
        Some(pose) => {
            // From the right camera's axes to the left one's.
            let (rotation, place_m) = parse_pose(pose)?;
            let rotation = rotation.transpose();
            Ok(StereoCalibration {
                cameras: [read_camera(root, left)?, read_camera(root, "Camera2")?],
                rotation,
                translation_m: entries::require_baseline(pose, -(rotation * place_m))?,
                stored_rectification: None,
                unit: LengthUnit::Stated,
            })
        }
        None => read_rectified(root, left),
    }
}

/// Reads a pose of 4x4 or, without the last row, of 3x4 numbers.
fn parse_pose(pose: Value<'_>) -> Result<(DMat3, DVec3), CalibrationError> {
    match pose.parse_numbers::<12>(3, "3x4") {
        Ok(m) => {
            let rotation = entries::parse_rotation(pose, &[m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]])?;
            Ok((rotation, DVec3::new(m[3], m[7], m[11])))
        }
        Err(_) => entries::parse_pose(pose),
    }
}

/// Reads a pair that is rectified: one camera, and the baseline in metres or times the focal length.
fn read_rectified(root: Value<'_>, name: &str) -> Result<StereoCalibration, CalibrationError> {
    let camera = read_camera(root, name)?;
    let (value, baseline_m) = match root.get("Stereo.b") {
        Some(baseline) => (baseline, baseline.number()?),
        None => {
            let product = root.require("Camera.bf", HINT)?;
            (product, product.number()? / camera.focal_px.x)
        }
    };
    let impossible = |value: Value<'_>, what| Err(value.to_error(Fault::Impossible { key: value.key(), what }));
    if camera.distortion != Distortion::RadialTangential([0.0; 8]) {
        let lens = root.require(&format!("{name}.k1"), HINT)?;
        return impossible(lens, "is not 0, as it must be in a rectified pair without LEFT.K or Stereo.T_c1_c2");
    }
    if baseline_m < 0.0 {
        return impossible(value, "is below 0: the left camera would stand on the right");
    }
    Ok(StereoCalibration {
        cameras: [camera; 2],
        rotation: DMat3::IDENTITY,
        translation_m: entries::require_baseline(value, DVec3::new(-baseline_m, 0.0, 0.0))?,
        stored_rectification: Some(Rectification {
            rotations: [DMat3::IDENTITY; 2],
            focal_px: camera.focal_px,
            centers_px: [camera.center_px; 2],
            baseline_m,
        }),
        unit: LengthUnit::Stated,
    })
}

fn read_camera(root: Value<'_>, name: &str) -> Result<CameraIntrinsics, CalibrationError> {
    let find = |key: &str| root.get(&format!("{name}.{key}"));
    let require = |key: &str| root.require(&format!("{name}.{key}"), HINT)?.number();
    let or_zero = |key: &str| find(key).map_or(Ok(0.0), |value| value.number());
    let first = root.require(&format!("{name}.fx"), HINT)?;
    let pinhole = [first.number()?, require("fy")?, require("cx")?, require("cy")?];
    let (focal_px, center_px): (DVec2, DVec2) = entries::parse_pinhole(first, pinhole)?;
    let [k1, k2, p1, p2, k3, k4] = {
        let mut numbers = [0.0; 6];
        for (number, key) in numbers.iter_mut().zip(["k1", "k2", "p1", "p2", "k3", "k4"]) {
            *number = or_zero(key)?;
        }
        numbers
    };
    let distortion = match root.get("Camera.type") {
        Some(model) if model.text()? == "KannalaBrandt8" => Distortion::Equidistant([k1, k2, k3, k4]),
        Some(model) if !["PinHole", "Rectified"].contains(&model.text()?) => {
            let known = "PinHole, KannalaBrandt8 or Rectified";
            return Err(model.to_error(Fault::Model { key: model.key(), found: model.text()?.into(), known }));
        }
        _ => Distortion::RadialTangential([k1, k2, p1, p2, k3, k4, or_zero("k5")?, or_zero("k6")?]),
    };
    let side = |key: &str| {
        let value = root.get(key);
        value.map(|value| entries::parse_side(value, value.parse_count()?.into())).transpose()
    };
    Ok(CameraIntrinsics { size: side("Camera.width")?.zip(side("Camera.height")?), focal_px, center_px, distortion })
}
