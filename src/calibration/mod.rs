//! Two cameras beside each other: how each images the world, how they stand, and what makes their pictures a pair with
//! the same point in the same row.

pub mod euroc;

use glam::{DMat3, DVec2, DVec3};

/// How a lens bends the rays of a pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    /// OpenCV's model, in its order: k1 k2 p1 p2 k3 k4 k5 k6 (radial, tangential, rational; unused ones are 0).
    RadialTangential([f64; 8]),
    /// Kannala and Brandt's fisheye: the angle to the axis becomes `t + k1 t^3 + k2 t^5 + k3 t^7 + k4 t^9`.
    Equidistant([f64; 4]),
}

/// One camera as it was calibrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eye {
    /// Columns and rows of the pictures that the numbers belong to.
    pub size: (u32, u32),
    /// Focal lengths along columns and rows, in pixels, > 0.
    pub focal_px: DVec2,
    /// Column and row of the principal point; pixel centres are at whole numbers.
    pub center_px: DVec2,
    /// Its lens.
    pub distortion: Distortion,
}

/// Two cameras, and how the right one stands: `x_right = rotation * x_left + translation_m`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StereoCalibration {
    /// Left, then right.
    pub eyes: [Eye; 2],
    /// From the left camera's axes to the right one's.
    pub rotation: DMat3,
    /// The left camera's place in the right one's axes; about `(-baseline, 0, 0)`.
    pub translation_m: DVec3,
}

/// Why a calibration cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    /// Nothing reads it yet.
    #[error("{0}: not read yet")]
    Unread(String),
}
