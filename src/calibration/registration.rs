//! Registration: reprojects a depth map into the view of the colour camera.
//!
//! Every depth pixel is a small square that faces its camera. It is drawn where the colour camera sees it, in the size
//! that it has there, with a z-buffer. Pixels that only the colour camera sees stay unknown. The squares are drawn for a
//! colour camera without distortion, from which the distorted picture takes the nearest pixels.

mod draw;
#[cfg(test)]
mod tests;
mod view;

use glam::{DMat3, DVec2, DVec3, Vec3};
use pulp::Arch;

use super::CameraIntrinsics;
use crate::frame::DepthMap;
use draw::DrawSquares;
use view::View;

/// Intrinsics of two cameras that look the same way, and the pose between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RgbdCalibration {
    /// The depth camera. Its size must be known.
    pub depth: CameraIntrinsics,
    /// The colour camera. Its size must be known.
    pub color: CameraIntrinsics,
    /// Rotation from the depth camera's axes to the colour camera's.
    pub rotation: DMat3,
    /// Position of the depth camera in the colour camera's axes, in metres.
    pub translation_m: DVec3,
}

/// Error of an invalid calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RgbdCalibrationError {
    /// A parameter of the depth camera is out of range.
    #[error("the depth camera's {0}")]
    Depth(&'static str),
    /// A parameter of the colour camera is out of range.
    #[error("the colour camera's {0}")]
    Color(&'static str),
    /// The pose between the cameras is invalid.
    #[error("{0}")]
    Pose(&'static str),
}

/// Largest deviation of a matrix from a rotation: calibrations are written with few digits.
const ROTATION_TOLERANCE: f64 = 1e-2;

/// Largest side of a depth or colour picture.
const MAX_SIDE_PX: u32 = 16384;
/// Largest number of pixels of depth maps: the tables have 16 bytes for each.
const MAX_DEPTH_PIXELS: u64 = 1 << 23;

impl CameraIntrinsics {
    /// Checks the ranges of the numbers.
    fn validate(&self) -> Result<(), &'static str> {
        let in_range = |side: u32| (1..=MAX_SIDE_PX).contains(&side);
        if !self.size.is_some_and(|(width, height)| in_range(width) && in_range(height)) {
            return Err("width and height must be from 1 to 16384 pixels");
        }
        if !self.focal_px.to_array().iter().all(|focal| (1.0..1e6).contains(focal)) {
            return Err("fx and fy must be focal lengths in pixels, from 1 to a million");
        }
        if !self.center_px.to_array().iter().all(|center| center.abs() < 1e5) {
            return Err("cx and cy must be a point in pixels");
        }
        if !self.distortion.coefficients().iter().all(|coefficient| coefficient.abs() < 1e4) {
            return Err("distortion must be coefficients of a lens");
        }
        Ok(())
    }

    /// Returns the same camera with pictures of another size, whose aspect may differ.
    fn resized(&self, size: (u32, u32)) -> Self {
        self.scaled(size, self.size.map_or(DVec2::ONE, |from| super::sides_px(size) / super::sides_px(from)))
    }
}

impl RgbdCalibration {
    /// Returns a calibration with both cameras in one place.
    pub fn identity(camera: CameraIntrinsics) -> Self {
        Self { depth: camera, color: camera, rotation: DMat3::IDENTITY, translation_m: DVec3::ZERO }
    }

    /// Checks the ranges of the numbers.
    ///
    /// # Errors
    /// Fails if a number is out of range, or the rotation matrix is not a rotation.
    pub fn validate(&self) -> Result<(), RgbdCalibrationError> {
        self.depth.validate().map_err(RgbdCalibrationError::Depth)?;
        let (width, height) = self.depth.size.unwrap_or_default();
        if u64::from(width) * u64::from(height) > MAX_DEPTH_PIXELS {
            return Err(RgbdCalibrationError::Depth("pictures have more than 8 megapixels"));
        }
        self.color.validate().map_err(RgbdCalibrationError::Color)?;
        let unit = self.rotation * self.rotation.transpose() - DMat3::IDENTITY;
        let is_unit = unit.to_cols_array().iter().all(|off| off.abs() <= ROTATION_TOLERANCE);
        if !(is_unit && self.rotation.determinant() > 0.0) {
            return Err(RgbdCalibrationError::Pose(
                "rotation must be a rotation matrix, row by row: rows of length 1 at right angles, determinant 1",
            ));
        }
        if !self.translation_m.to_array().iter().all(|metres| metres.abs() < 10.0) {
            return Err(RgbdCalibrationError::Pose("translation_m must be in metres, less than 10 each"));
        }
        Ok(())
    }
}

/// Reprojects depth maps of one size into the colour camera's view.
#[derive(Debug)]
pub struct Registration {
    calibration: RgbdCalibration,
    /// Columns and rows of the depth maps.
    size: (u32, u32),
    rays: Rays,
    /// Focal lengths of the depth camera, in pixels.
    depth_focal_px: DVec2,
    view: View,
    arch: Arch,
}

/// Directions of the depth pixels' rays in the colour camera's axes, with a length of 1 along the depth camera's axis.
#[derive(Debug)]
enum Rays {
    /// Of a depth camera without distortion: `x / z` of each column in its axes, and the ray of the middle of each row.
    Pinhole { columns: Vec<f32>, rows: Vec<Vec3> },
    /// For each pixel x, y and z, NaN where the lens sees nothing; and the side of its square relative to that of a pixel
    /// without distortion.
    Lens([Vec<f32>; 4]),
}

impl Rays {
    fn new(depth: &CameraIntrinsics, (width, height): (u32, u32), rotation: DMat3) -> Self {
        let CameraIntrinsics { focal_px, center_px, distortion, .. } = *depth;
        if distortion.is_none() {
            let down = |y: u32| rotation.y_axis * ((f64::from(y) - center_px.y) / focal_px.y) + rotation.z_axis;
            return Self::Pinhole {
                columns: (0..width).map(|x| ((f64::from(x) - center_px.x) / focal_px.x) as f32).collect(),
                rows: (0..height).map(|y| down(y).as_vec3()).collect(),
            };
        }
        let max_radius = distortion.max_radius();
        let flat_ray = |x: u32, y: u32| depth.unproject(DVec2::new(x.into(), y.into()), max_radius);
        // Each row and each column has one more, for the size of the last squares.
        let flats: Vec<DVec2> = (0..=height).flat_map(|y| (0..=width).map(move |x| flat_ray(x, y))).collect();
        let row = width as usize + 1;
        let mut tables = [(); 4].map(|()| Vec::with_capacity(width as usize * height as usize));
        for at in (0..height as usize).flat_map(|y| (0..width as usize).map(move |x| y * row + x)) {
            // Rays beyond the lens's reach are all clamped to it.
            let is_seen = flats[at].length() < max_radius * (1.0 - 1e-9);
            let ray = if is_seen { rotation * flats[at].extend(1.0) } else { DVec3::NAN };
            let sides = [flats[at + 1], flats[at + row]].map(|next| ((next - flats[at]) * focal_px).length());
            for (table, value) in tables.iter_mut().zip([ray.x, ray.y, ray.z, sides[0].max(sides[1])]) {
                table.push(value as f32);
            }
        }
        Self::Lens(tables)
    }
}

impl Registration {
    /// Creates a registration for maps of `size` (columns, rows) with the field of view of the calibrated depth camera.
    ///
    /// # Errors
    /// Fails if the calibration is invalid.
    pub fn new(calibration: RgbdCalibration, size: (u32, u32)) -> Result<Self, RgbdCalibrationError> {
        calibration.validate()?;
        Ok(Self::build(calibration, size))
    }

    /// Returns columns and rows of the depth maps.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Reprojects `from`, which has this [`Registration::size`], into `into`, which covers the colour camera's view in
    /// the resolution of `from`, but at most that of the colour camera. `scratch` is overwritten. After the first map
    /// nothing is allocated.
    ///
    /// # Panics
    /// `from` has another size.
    pub fn register(&self, from: &DepthMap, scratch: &mut DepthMap, into: &mut DepthMap) {
        assert_eq!(from.size(), self.size, "a map of another size");
        let drawn = if self.view.is_picture() { &mut *into } else { &mut *scratch };
        let (width, height) = self.view.drawn_size();
        drawn.resize(width, height);
        self.arch.dispatch(DrawSquares { registration: self, from: &from.metres, into: &mut drawn.metres });
        if !self.view.is_picture() {
            self.view.distort(scratch, into);
        }
    }

    /// Computes the tables for maps of `size`.
    fn build(calibration: RgbdCalibration, size: (u32, u32)) -> Self {
        let RgbdCalibration { color, rotation, .. } = calibration;
        let depth = calibration.depth.resized(size);
        // Limits the resolution to that of the depth, in pixels per degree.
        let (width, height) = color.size.unwrap_or_default();
        let most = (MAX_DEPTH_PIXELS as f64 / (f64::from(width) * f64::from(height))).sqrt();
        let finer = (depth.focal_px / color.focal_px).max_element().min(most).min(1.0);
        let side = |px: u32| ((f64::from(px) * finer).round() as u32).max(1);
        let view = View::new(&color.resized((side(width), side(height))));

        let rays = Rays::new(&depth, size, rotation);
        Self { calibration, size, rays, depth_focal_px: depth.focal_px, view, arch: Arch::new() }
    }
}

/// Registers maps whose size may change from one to the next.
#[derive(Debug)]
pub struct AnySizeRegistration {
    calibration: RgbdCalibration,
    /// For maps of the size of the last one.
    registration: Option<Registration>,
    scratch: DepthMap,
}

impl AnySizeRegistration {
    /// Creates a registration.
    ///
    /// # Errors
    /// Fails if the calibration is invalid.
    pub fn new(calibration: RgbdCalibration) -> Result<Self, RgbdCalibrationError> {
        calibration.validate()?;
        Ok(Self { calibration, registration: None, scratch: DepthMap::default() })
    }

    /// Reprojects `from` into `into` as [`Registration::register`] does.
    pub fn register(&mut self, from: &DepthMap, into: &mut DepthMap) {
        let fitting = self.registration.take().filter(|registration| registration.size() == from.size());
        let registration = fitting.unwrap_or_else(|| Registration::build(self.calibration, from.size()));
        self.registration.insert(registration).register(from, &mut self.scratch, into);
    }
}
