//! Calibrations: their files, the geometry of rectified pairs, and resampled pictures.
#![allow(missing_docs)]

mod files;
mod formats;
mod geometry;
mod pictures;
mod real;
mod writers;

use bokehcam::calibration::{CameraIntrinsics, Distortion, LengthUnit, StereoCalibration};
use glam::{DMat3, DQuat, DVec2, DVec3};

const SIZE: (u32, u32) = (640, 480);
const RADTAN: Distortion = Distortion::RadialTangential([-0.28, 0.074, 0.0002, -0.0003, 0.01, 0.0, 0.0, 0.002]);
const FISHEYE: Distortion = Distortion::Equidistant([0.0034, 0.0007, -0.0020, 0.0002]);
const NONE: Distortion = Distortion::RadialTangential([0.0; 8]);

/// Creates cameras 11 cm apart with slightly different focal lengths, the right one turned by `turn_deg` about x, y and
/// z.
fn rig(distortion: Distortion, focal_px: f64, turn_deg: [f64; 3]) -> StereoCalibration {
    let eye = |dx: f64, scale: f64| CameraIntrinsics {
        size: Some(SIZE),
        focal_px: DVec2::new(focal_px, focal_px * 0.997) * scale,
        center_px: DVec2::new(322.0 + dx, 236.5 - dx / 2.0),
        distortion,
    };
    let turn = DVec3::from_array(turn_deg.map(f64::to_radians));
    StereoCalibration {
        cameras: [eye(0.0, 1.0), eye(5.0, 1.004)],
        rotation: DMat3::from_quat(DQuat::from_scaled_axis(turn)),
        translation_m: DVec3::new(-0.11, 0.004, -0.006),
        stored_rectification: None,
        unit: LengthUnit::Stated,
    }
}

/// Returns rigs of all kinds.
fn rigs() -> Vec<StereoCalibration> {
    vec![
        rig(RADTAN, 460.0, [0.0; 3]),
        rig(RADTAN, 460.0, [1.5, -3.0, 2.0]),
        rig(FISHEYE, 250.0, [-2.0, 5.0, 1.0]),
        rig(FISHEYE, 190.0, [0.0, -1.0, 0.0]),
        rig(NONE, 700.0, [0.3, 0.5, -0.7]),
    ]
}
