//! Registration: reprojects a depth map into the view of the colour camera.
//!
//! Every depth pixel is a small square that faces its camera. It is drawn where the colour camera sees it, in the size
//! that it has there, with a z-buffer. Pixels that only the colour camera sees stay unknown.

mod draw;

use draw::DrawSquares;
use glam::{Mat3, Vec3};
use pulp::Arch;

use crate::frame::DepthMap;

/// A pinhole camera without distortion. Pixel centres have whole coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pinhole {
    /// Columns of the calibration pictures.
    pub width: u32,
    /// Rows of the calibration pictures.
    pub height: u32,
    /// Focal length across, in pixels.
    pub fx: f32,
    /// Focal length down, in pixels.
    pub fy: f32,
    /// Column of the optical axis.
    pub cx: f32,
    /// Row of the optical axis.
    pub cy: f32,
}

/// Intrinsics of two cameras that look the same way, and the pose between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// The depth camera.
    pub depth: Pinhole,
    /// The colour camera.
    pub color: Pinhole,
    /// Rotation from the depth camera's axes to the colour camera's.
    pub rotation: Mat3,
    /// Position of the depth camera in the colour camera's axes, in metres.
    pub translation_m: Vec3,
}

/// Error of an invalid calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CalibrationError {
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
const ROTATION_TOLERANCE: f32 = 1e-2;

impl Pinhole {
    fn validate(&self) -> Result<(), &'static str> {
        const MAX_SIDE_PX: u32 = 8192;
        let in_range = |side: u32| (1..=MAX_SIDE_PX).contains(&side);
        if !in_range(self.width) || !in_range(self.height) {
            return Err("width and height must be from 1 to 8192 pixels");
        }
        if ![self.fx, self.fy].iter().all(|focal| (1.0..1e6).contains(focal)) {
            return Err("fx and fy must be focal lengths in pixels, from 1 to a million");
        }
        if ![self.cx, self.cy].iter().all(|center| center.abs() < 1e5) {
            return Err("cx and cy must be a point in pixels");
        }
        Ok(())
    }

    /// Returns the camera for pictures of another size.
    fn resized(&self, width: u32, height: u32) -> Self {
        let (across, down) = (width as f32 / self.width as f32, height as f32 / self.height as f32);
        Self {
            width,
            height,
            fx: self.fx * across,
            fy: self.fy * down,
            cx: (self.cx + 0.5) * across - 0.5,
            cy: (self.cy + 0.5) * down - 0.5,
        }
    }
}

impl Calibration {
    /// Returns a calibration with both cameras in one place.
    pub fn identity(camera: Pinhole) -> Self {
        Self { depth: camera, color: camera, rotation: Mat3::IDENTITY, translation_m: Vec3::ZERO }
    }

    /// Checks the ranges of the numbers.
    ///
    /// # Errors
    /// Fails if a number is out of range, or the rotation matrix is not a rotation.
    pub fn validate(&self) -> Result<(), CalibrationError> {
        self.depth.validate().map_err(CalibrationError::Depth)?;
        self.color.validate().map_err(CalibrationError::Color)?;
        let unit = self.rotation * self.rotation.transpose() - Mat3::IDENTITY;
        let off = unit.to_cols_array().into_iter().fold(0.0, |most: f32, off| most.max(off.abs()));
        // The negated comparison also rejects NaN.
        if !(off <= ROTATION_TOLERANCE && self.rotation.determinant() > 0.0) {
            return Err(CalibrationError::Pose(
                "rotation must be a rotation matrix, row by row: rows of length 1 at right angles, determinant 1",
            ));
        }
        if !self.translation_m.to_array().iter().all(|metres| metres.abs() < 10.0) {
            return Err(CalibrationError::Pose("translation_m must be in metres, less than 10 each"));
        }
        Ok(())
    }
}

/// Reprojects depth maps of one size into the colour camera's view. Owns its buffers.
#[derive(Debug)]
pub struct Registration {
    calibration: Calibration,
    /// Size of the depth maps that the tables are valid for.
    size: (u32, u32),
    depth: Pinhole,
    out: Pinhole,
    /// `x / z` of the ray of each column in the depth camera's axes.
    columns: Vec<f32>,
    /// The ray of the middle of each row with `z` = 1, in the colour camera's axes.
    rows: Vec<Vec3>,
    arch: Arch,
}

impl Registration {
    /// Creates a registration for maps of any size with the field of view of the calibrated depth camera.
    ///
    /// # Errors
    /// Fails if the calibration is invalid.
    pub fn new(calibration: Calibration) -> Result<Self, CalibrationError> {
        calibration.validate()?;
        let Calibration { depth, color: out, .. } = calibration;
        let (columns, rows, arch) = (Vec::new(), Vec::new(), Arch::new());
        Ok(Self { calibration, size: (0, 0), depth, out, columns, rows, arch })
    }

    /// Reprojects `from` into `into`, which covers the colour camera's view in the resolution of `from`, but at most
    /// that of the colour camera. After the first map of a size nothing is allocated.
    pub fn register(&mut self, from: &DepthMap, into: &mut DepthMap) {
        if from.size() != self.size {
            self.update_tables(from.size());
        }
        into.resize(self.out.width, self.out.height);
        self.arch.dispatch(DrawSquares { registration: self, from: &from.metres, into: &mut into.metres });
    }

    /// Computes the tables for maps of another size.
    fn update_tables(&mut self, size: (u32, u32)) {
        let Calibration { depth, color, rotation, .. } = self.calibration;
        self.size = size;
        self.depth = depth.resized(size.0, size.1);
        // Limits the resolution to that of the depth, in pixels per degree.
        let finer = (self.depth.fx / color.fx).max(self.depth.fy / color.fy).min(1.0);
        let side = |px: u32| ((px as f32 * finer).round() as u32).max(1);
        self.out = color.resized(side(color.width), side(color.height));
        let camera = &self.depth;
        self.columns.clear();
        self.columns.extend((0..size.0).map(|x| (x as f32 - camera.cx) / camera.fx));
        self.rows.clear();
        let down = |y: u32| rotation.y_axis * ((y as f32 - camera.cy) / camera.fy) + rotation.z_axis;
        self.rows.extend((0..size.1).map(down));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Pinhole = Pinhole { width: 80, height: 60, fx: 70.0, fy: 70.0, cx: 39.5, cy: 29.5 };

    fn map(width: u32, height: u32, depth: impl Fn(f32, f32) -> f32) -> DepthMap {
        let metres = (0..width * height).map(|k| depth((k % width) as f32, (k / width) as f32)).collect();
        DepthMap { width, height, metres, ..DepthMap::default() }
    }

    fn registered(calibration: Calibration, from: &DepthMap) -> DepthMap {
        let mut into = DepthMap::default();
        Registration::new(calibration).unwrap().register(from, &mut into);
        into
    }

    #[test]
    fn one_camera_sees_what_it_saw() {
        let from = map(80, 60, |x, y| if (x + y) % 7.0 == 0.0 { 0.0 } else { 0.5 + 0.1 * x + 0.03 * y });
        let into = registered(Calibration::identity(CAMERA), &from);
        assert_eq!(into.size(), from.size());
        for (into, from) in into.metres.iter().zip(&from.metres) {
            assert!((into - from).abs() <= 1e-6 * from, "{into} {from}");
        }
        // Also with pictures of another size.
        let half = map(40, 30, |x, _| 1.0 + x);
        assert_eq!(registered(Calibration::identity(CAMERA), &half), half);
    }

    #[test]
    fn a_slanted_plane_is_where_it_is_for_another_camera() {
        // The plane through (0, 0, 2) with this normal, both in the colour camera's space.
        let (point, normal) = (Vec3::new(0.0, 0.0, 2.0), Vec3::new(0.3, -0.2, -1.0).normalize());
        let rotation = Mat3::from_rotation_y(0.08) * Mat3::from_rotation_x(-0.05) * Mat3::from_rotation_z(0.03);
        let translation_m = Vec3::new(0.06, -0.01, 0.02);
        let depth = Pinhole { width: 320, height: 240, fx: 290.0, fy: 292.0, cx: 161.0, cy: 118.0 };
        let color = Pinhole { width: 640, height: 360, fx: 600.0, fy: 600.0, cx: 318.0, cy: 182.0 };
        let calibration = Calibration { depth, color, rotation, translation_m };
        let from = map(320, 240, |x, y| {
            let ray = rotation * Vec3::new((x - depth.cx) / depth.fx, (y - depth.cy) / depth.fy, 1.0);
            (point - translation_m).dot(normal) / ray.dot(normal)
        });
        let into = registered(calibration, &from);
        let out = color.resized(into.width, into.height);
        assert_eq!(into.size(), (311, 175), "as fine as the depth");
        let (mut known, mut inner) = (0, 0);
        for (k, &z_m) in into.metres.iter().enumerate() {
            let (x, y) = (k as u32 % into.width, k as u32 / into.width);
            // The part that both cameras see.
            let inside = (50..into.width - 50).contains(&x) && (35..into.height - 35).contains(&y);
            inner += u32::from(inside);
            if z_m > 0.0 {
                let ray = Vec3::new((x as f32 - out.cx) / out.fx, (y as f32 - out.cy) / out.fy, 1.0);
                let exact_m = point.dot(normal) / ray.dot(normal);
                // Tolerance: the slope of the plane within a pixel.
                assert!((z_m - exact_m).abs() < 0.006, "{z_m} {exact_m} at {x}, {y}");
                known += u32::from(inside);
            }
        }
        assert_eq!(known, inner, "no gaps");
    }

    #[test]
    fn what_is_near_hides_what_is_behind_and_leaves_a_shadow() {
        let translation_m = Vec3::new(-0.1, 0.0, 0.0);
        let calibration = Calibration { translation_m, ..Calibration::identity(CAMERA) };
        let in_box = |x: f32, y: f32| (30.0..50.0).contains(&x) && (20.0..40.0).contains(&y);
        let from = map(80, 60, |x, y| if in_box(x, y) { 1.0 } else { 3.5 });
        let into = registered(calibration, &from);
        let at = |x: usize, y: usize| into.metres[y * 80 + x];
        // The box moves by 7 pixels, and the wall by 2.
        for y in 20..40 {
            assert!((23..43).all(|x| at(x, y) == 1.0), "row {y}");
            assert!((43..48).all(|x| at(x, y) == 0.0), "the shadow, row {y}");
            assert!((48..78).chain(0..23).all(|x| at(x, y) == 3.5), "row {y}");
        }
        assert!((0..78).all(|x| at(x, 10) == 3.5) && (78..80).all(|x| at(x, 10) == 0.0));
    }

    #[test]
    fn a_surface_that_comes_nearer_has_no_gaps() {
        for z_m in [0.3, 0.5, 1.0, 2.7] {
            let calibration =
                Calibration { translation_m: Vec3::new(0.013, 0.007, -0.05), ..Calibration::identity(CAMERA) };
            let into = registered(calibration, &map(80, 60, |_, _| z_m));
            let inside = (10..50).flat_map(|y| (10..70).map(move |x| y * 80 + x));
            assert!(inside.into_iter().all(|k| (into.metres[k] - z_m + 0.05).abs() < 1e-5), "{z_m}");
        }
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let good = Calibration::identity(CAMERA);
        let refusal = |calibration: Calibration| Registration::new(calibration).unwrap_err().to_string();
        assert!(refusal(Calibration { rotation: Mat3::ZERO, ..good }).contains("rotation matrix"));
        assert!(
            refusal(Calibration { rotation: Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0)), ..good }).contains("1")
        );
        assert!(refusal(Calibration { rotation: Mat3::from_diagonal(Vec3::NAN), ..good }).contains("rotation matrix"));
        assert!(refusal(Calibration { translation_m: Vec3::new(50.0, 0.0, 0.0), ..good }).contains("metres"));
        assert!(refusal(Calibration { depth: Pinhole { fx: 0.0, ..CAMERA }, ..good }).contains("depth camera's fx"));
        assert!(
            refusal(Calibration { color: Pinhole { width: 0, ..CAMERA }, ..good }).contains("colour camera's width")
        );
        assert!(refusal(Calibration { color: Pinhole { cy: f32::NAN, ..CAMERA }, ..good }).contains("cx and cy"));
    }

    #[test]
    fn odd_depths_and_sizes_do_no_harm() {
        let mut registration = Registration::new(Calibration::identity(CAMERA)).unwrap();
        let mut into = DepthMap::default();
        for from in [
            DepthMap::default(),
            map(1, 1, |_, _| 1.0),
            map(80, 60, |x, _| [f32::NAN, f32::INFINITY, -1.0, 1e-30, 1e30][x as usize % 5]),
        ] {
            registration.register(&from, &mut into);
            assert!(into.metres.iter().all(|z_m| z_m.is_finite() && *z_m >= 0.0));
        }
    }
}
