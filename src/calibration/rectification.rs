//! The virtual cameras of a rectified pair: rotated to the same direction, with rows parallel to the baseline, the same
//! focal lengths and the same row of the principal point.
//!
//! Bouguet's method: each camera is rotated by half of the rotation between them, so that both pictures are distorted
//! equally, then both together until the baseline is parallel to the rows.

use glam::{DMat3, DQuat, DVec2, DVec3};

use super::{CalibrationError, CameraIntrinsics, Fault, StereoCalibration};
use crate::optics::StereoRig;

/// Minimum ratio of the rectified focal length to the cameras' own: a fisheye's rim is cropped before its centre loses
/// more detail.
const MIN_FOCAL_RATIO: f64 = 0.7;
/// Maximum ratio of the rectified focal length to the cameras' own: beyond it, the views overlap too little.
const MAX_FOCAL_RATIO: f64 = 3.0;
/// Points along each border of a picture that are projected into the rectified one.
const BORDER_POINTS: u32 = 256;
/// Minimum z, after rotation, of a ray with z = 1: flatter ones would meet the rectified plane near infinity, or
/// behind.
const MIN_RAY_Z: f64 = 0.1;

/// Rotations and intrinsics of a rectified pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectification {
    /// Rotations from each camera's own axes (left, right) to the rectified ones.
    pub rotations: [DMat3; 2],
    /// Focal lengths along columns and rows of both rectified pictures, in pixels.
    pub focal_px: DVec2,
    /// Principal points of the left and of the right rectified picture, in the same row.
    pub centers_px: [DVec2; 2],
    /// Distance between the cameras in metres, > 0.
    pub baseline_m: f64,
}

impl Rectification {
    /// Returns the rectification of a calibration for pictures of `size`: the file's own, or else Bouguet's. In the
    /// latter both pictures show the same directions, so that the disparity of infinity is 0, in the largest window of
    /// the pictures' aspect within both views, so that no corner is black; but with a focal length of at least 0.7
    /// times the cameras' own.
    ///
    /// # Errors
    /// Fails if the pictures have another aspect; if the cameras are swapped, not side by side, or look in too
    /// different directions; or if numbers are invalid.
    pub fn from_calibration(calibration: &StereoCalibration, size: (u32, u32)) -> Result<Self, CalibrationError> {
        let calibration = calibration.scale_to(size)?;
        let translation_m = calibration.half_rotated_translation_m();
        let impossible = |key: &str, what| Fault::Impossible { key: key.into(), what };
        if !translation_m.is_finite() || translation_m.length() < 1e-9 {
            return Err(impossible("the translation", "puts both cameras in the same place").into());
        }
        if calibration
            .cameras
            .iter()
            .any(|camera| !(camera.focal_px.is_finite() && camera.focal_px.min_element() > 0.0))
        {
            return Err(impossible("the focal length", "is not above 0").into());
        }
        if translation_m.y.abs() > translation_m.x.abs() {
            return Err(CalibrationError::NotSideBySide("above"));
        }
        if translation_m.z.abs() > translation_m.x.abs() {
            return Err(CalibrationError::NotSideBySide("behind"));
        }
        if calibration.is_swapped() {
            return Err(CalibrationError::Swapped);
        }
        if let Some(given) = calibration.stored_rectification {
            return Ok(given);
        }
        let half_rotation = calibration.half_rotation();
        // In the right camera's axes the left camera then lies along -x.
        let onto_rows = DMat3::from_quat(DQuat::from_rotation_arc(translation_m.normalize(), DVec3::NEG_X));
        let rotations = [onto_rows * half_rotation.transpose(), onto_rows * half_rotation];
        let (focal_px, center_px) = find_common_window(&calibration.cameras, &rotations, size)?;
        let focal_px = DVec2::splat(focal_px);
        Ok(Self { rotations, focal_px, centers_px: [center_px; 2], baseline_m: calibration.baseline_m() })
    }

    /// Returns the rectification with left and right exchanged.
    #[must_use]
    pub fn with_swapped_cameras(&self) -> Self {
        let ([left, right], [left_px, right_px]) = (self.rotations, self.centers_px);
        Self { rotations: [right, left], centers_px: [right_px, left_px], ..*self }
    }

    /// Returns the rig that converts disparities of the rectified pair to depth.
    pub fn rig(&self) -> StereoRig {
        let [left_px, right_px] = self.centers_px;
        StereoRig {
            focal_px: self.focal_px.x as f32,
            baseline_m: self.baseline_m as f32,
            doffs_px: (right_px.x - left_px.x) as f32,
            metric: true,
        }
    }

    /// Returns the direction of a pixel of a rectified picture (0 left, 1 right), in that camera's own axes.
    pub(super) fn pixel_direction(&self, side: usize, pixel_px: DVec2) -> DVec3 {
        let flat = (pixel_px - self.centers_px[side]) / self.focal_px;
        self.rotations[side].transpose() * flat.extend(1.0)
    }
}

/// Returns focal length and principal point, in pixels, of the largest window of the pictures' aspect within both
/// views.
fn find_common_window(
    cameras: &[CameraIntrinsics; 2],
    rotations: &[DMat3; 2],
    size: (u32, u32),
) -> Result<(f64, DVec2), CalibrationError> {
    let last_px = DVec2::new(f64::from(size.0) - 1.0, f64::from(size.1) - 1.0);
    // Corners of the window on the rectified plane at distance 1: no border point of either picture may lie inside.
    let (mut low, mut high) = (DVec2::NEG_INFINITY, DVec2::INFINITY);
    for (camera, rotation) in cameras.iter().zip(rotations) {
        let max_radius = camera.distortion.max_radius();
        let rectified = |pixel_px: DVec2| {
            let direction = *rotation * camera.unproject(pixel_px, max_radius).extend(1.0);
            direction.truncate() / direction.z.max(MIN_RAY_Z)
        };
        for k in 0..=BORDER_POINTS {
            let along_px = last_px * f64::from(k) / f64::from(BORDER_POINTS);
            low.x = low.x.max(rectified(DVec2::new(0.0, along_px.y)).x);
            high.x = high.x.min(rectified(DVec2::new(last_px.x, along_px.y)).x);
            low.y = low.y.max(rectified(DVec2::new(along_px.x, 0.0)).y);
            high.y = high.y.min(rectified(DVec2::new(along_px.x, last_px.y)).y);
        }
    }
    let extent = high - low;
    let mean_focal_px = cameras.iter().map(|camera| camera.focal_px.element_sum()).sum::<f64>() / 4.0;
    // The focal length at which the picture just fits into the extent.
    let needed_px = (last_px / extent).max_element();
    if extent.min_element() <= 0.0 || needed_px > mean_focal_px * MAX_FOCAL_RATIO {
        return Err(CalibrationError::LittleOverlap);
    }
    let focal_px = needed_px.max(mean_focal_px * MIN_FOCAL_RATIO);
    // Maps the window's centre to the picture's centre.
    Ok((focal_px, last_px / 2.0 - focal_px * (low + high) / 2.0))
}
