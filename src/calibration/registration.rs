//! Registration: reprojects a depth map into the view of the colour camera.
//!
//! Every depth pixel is a small square that faces its camera. It is drawn where the colour camera sees it, in the size
//! that it has there, with a z-buffer. Pixels that only the colour camera sees stay unknown. The squares are drawn for a
//! colour camera without distortion, from which the distorted picture takes the nearest pixels.

mod draw;
mod view;

use glam::{DMat3, DVec2, DVec3};
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
        let scale = self.size.map_or(DVec2::ONE, |from| super::sides_px(size) / super::sides_px(from));
        Self {
            size: Some(size),
            focal_px: self.focal_px * scale,
            center_px: super::scale_point_px(self.center_px, scale),
            ..*self
        }
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
    /// For each depth pixel the direction of its ray in the colour camera's axes, with a length of 1 along the depth
    /// camera's axis: x, y and z. NaN where the lens sees nothing.
    rays: [Vec<f32>; 3],
    /// For each depth pixel the side of its square relative to that of a pixel without distortion.
    spreads: Vec<f32>,
    /// Focal lengths of the depth camera, in pixels.
    depth_focal_px: DVec2,
    view: View,
    arch: Arch,
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

    /// Returns columns and rows of the maps in the colour camera's view.
    pub fn picture_size(&self) -> (u32, u32) {
        self.view.picture_size()
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

        let max_radius = depth.distortion.max_radius();
        let is_pinhole = depth.distortion.is_none();
        let flat_ray = |x: u32, y: u32| {
            let pixel_px = DVec2::new(x.into(), y.into());
            match is_pinhole {
                true => (pixel_px - depth.center_px) / depth.focal_px,
                false => depth.unproject(pixel_px, max_radius),
            }
        };
        // Each row and each column has one more, for the size of the last squares.
        let flats: Vec<DVec2> = (0..=size.1).flat_map(|y| (0..=size.0).map(move |x| flat_ray(x, y))).collect();
        let row = size.0 as usize + 1;
        let count = size.0 as usize * size.1 as usize;
        let mut rays = [(); 3].map(|()| Vec::with_capacity(count));
        let mut spreads = Vec::with_capacity(count);
        for at in (0..size.1 as usize).flat_map(|y| (0..size.0 as usize).map(move |x| y * row + x)) {
            // Rays beyond the lens's reach are all clamped to it.
            let is_seen = is_pinhole || flats[at].length() < max_radius * (1.0 - 1e-9);
            let ray = if is_seen { rotation * flats[at].extend(1.0) } else { DVec3::NAN };
            for (table, part) in rays.iter_mut().zip(ray.to_array()) {
                table.push(part as f32);
            }
            let sides = [flats[at + 1], flats[at + row]].map(|next| ((next - flats[at]) * depth.focal_px).length());
            spreads.push(sides[0].max(sides[1]) as f32);
        }
        Self { calibration, size, rays, spreads, depth_focal_px: depth.focal_px, view, arch: Arch::new() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::Distortion;

    const PINHOLE: Distortion = Distortion::RadialTangential([0.0; 8]);
    const CAMERA: CameraIntrinsics = camera((80, 60), (70.0, 70.0), (39.5, 29.5), PINHOLE);

    const fn camera(
        size: (u32, u32),
        (fx, fy): (f64, f64),
        (cx, cy): (f64, f64),
        distortion: Distortion,
    ) -> CameraIntrinsics {
        let (focal_px, center_px) = (DVec2::new(fx, fy), DVec2::new(cx, cy));
        CameraIntrinsics { size: Some(size), focal_px, center_px, distortion }
    }

    fn map(width: u32, height: u32, depth: impl Fn(f32, f32) -> f32) -> DepthMap {
        let metres = (0..width * height).map(|k| depth((k % width) as f32, (k / width) as f32)).collect();
        DepthMap { width, height, metres, ..DepthMap::default() }
    }

    fn registered(calibration: RgbdCalibration, from: &DepthMap) -> DepthMap {
        let (mut scratch, mut into) = Default::default();
        Registration::new(calibration, from.size()).unwrap().register(from, &mut scratch, &mut into);
        into
    }

    #[test]
    fn one_camera_sees_what_it_saw() {
        let from = map(80, 60, |x, y| if (x + y) % 7.0 == 0.0 { 0.0 } else { 0.5 + 0.1 * x + 0.03 * y });
        let into = registered(RgbdCalibration::identity(CAMERA), &from);
        assert_eq!(into.size(), from.size());
        for (into, from) in into.metres.iter().zip(&from.metres) {
            assert!((into - from).abs() <= 1e-6 * from, "{into} {from}");
        }
        // Also with pictures of another size.
        let half = map(40, 30, |x, _| 1.0 + x);
        assert_eq!(registered(RgbdCalibration::identity(CAMERA), &half), half);
    }

    #[test]
    fn a_slanted_plane_is_where_it_is_for_another_camera() {
        // As of a time-of-flight camera and of webcams with a wide and a fisheye lens.
        let rational = Distortion::RadialTangential([3.13, 2.32, 1e-4, -5e-5, 0.13, 3.46, 3.35, 0.66]);
        let wide = Distortion::RadialTangential([-0.28, 0.07, 2e-4, 1e-4, 0.0, 0.0, 0.0, 0.0]);
        let fisheye = Distortion::Equidistant([0.0034, 0.0007, -0.0020, 0.0002]);
        for (of_depth, of_color) in [(PINHOLE, PINHOLE), (rational, PINHOLE), (PINHOLE, wide), (rational, fisheye)] {
            check_slanted_plane(of_depth, of_color);
        }
    }

    fn check_slanted_plane(of_depth: Distortion, of_color: Distortion) {
        // The plane through (0, 0, 2) with this normal, both in the colour camera's space.
        let (point, normal) = (DVec3::new(0.0, 0.0, 2.0), DVec3::new(0.3, -0.2, -1.0).normalize());
        let rotation = DMat3::from_rotation_y(0.08) * DMat3::from_rotation_x(-0.05) * DMat3::from_rotation_z(0.03);
        let translation_m = DVec3::new(0.06, -0.01, 0.02);
        let depth = camera((160, 120), (145.0, 146.0), (80.5, 59.0), of_depth);
        let color = camera((320, 180), (300.0, 300.0), (159.0, 91.0), of_color);
        let ray = |camera: &CameraIntrinsics, x: f32, y: f32| {
            camera.unproject(DVec2::new(x.into(), y.into()), camera.distortion.max_radius()).extend(1.0)
        };
        let from = map(160, 120, |x, y| {
            ((point - translation_m).dot(normal) / (rotation * ray(&depth, x, y)).dot(normal)) as f32
        });
        let into = registered(RgbdCalibration { depth, color, rotation, translation_m }, &from);
        let out = color.resized(into.size());
        assert_eq!(into.size(), (156, 88), "as fine as the depth");
        let (mut known, mut inner) = (0, 0);
        for (k, &z_m) in into.metres.iter().enumerate() {
            let (x, y) = (k as u32 % into.width, k as u32 / into.width);
            // The part that both cameras see.
            let inside = (25..into.width - 25).contains(&x) && (18..into.height - 18).contains(&y);
            inner += u32::from(inside);
            if z_m > 0.0 {
                let exact_m = point.dot(normal) / ray(&out, x as f32, y as f32).dot(normal);
                // Tolerance: the slope of the plane within a pixel, or two with a lens.
                let tolerance_m = if of_color.is_none() { 0.012 } else { 0.02 };
                assert!((f64::from(z_m) - exact_m).abs() < tolerance_m, "{z_m} {exact_m} at {x}, {y}: {of_color:?}");
                known += u32::from(inside);
            }
        }
        assert_eq!(known, inner, "no gaps with {of_depth:?} and {of_color:?}");
    }

    #[test]
    fn what_is_near_hides_what_is_behind_and_leaves_a_shadow() {
        let translation_m = DVec3::new(-0.1, 0.0, 0.0);
        let calibration = RgbdCalibration { translation_m, ..RgbdCalibration::identity(CAMERA) };
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
                RgbdCalibration { translation_m: DVec3::new(0.013, 0.007, -0.05), ..RgbdCalibration::identity(CAMERA) };
            let into = registered(calibration, &map(80, 60, |_, _| z_m));
            let inside = (10..50).flat_map(|y| (10..70).map(move |x| y * 80 + x));
            assert!(inside.into_iter().all(|k| (into.metres[k] - z_m + 0.05).abs() < 1e-5), "{z_m}");
        }
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let good = RgbdCalibration::identity(CAMERA);
        let refusal = |calibration: RgbdCalibration| Registration::new(calibration, (4, 2)).unwrap_err().to_string();
        for rotation in
            [DMat3::ZERO, DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)), DMat3::from_diagonal(DVec3::NAN)]
        {
            assert!(refusal(RgbdCalibration { rotation, ..good }).contains("rotation matrix"));
        }
        let translation_m = DVec3::new(50.0, 0.0, 0.0);
        assert!(refusal(RgbdCalibration { translation_m, ..good }).contains("metres"));
        let depth = CameraIntrinsics { focal_px: DVec2::ZERO, ..CAMERA };
        assert!(refusal(RgbdCalibration { depth, ..good }).contains("depth camera's fx"));
        for size in [None, Some((0, 60)), Some((80, 20_000))] {
            let color = CameraIntrinsics { size, ..CAMERA };
            assert!(refusal(RgbdCalibration { color, ..good }).contains("colour camera's width"));
        }
        let depth = CameraIntrinsics { size: Some((4000, 3000)), ..CAMERA };
        assert!(refusal(RgbdCalibration { depth, ..good }).contains("8 megapixels"));
        let color = CameraIntrinsics { center_px: DVec2::NAN, ..CAMERA };
        assert!(refusal(RgbdCalibration { color, ..good }).contains("cx and cy"));
        let color = CameraIntrinsics { distortion: Distortion::Equidistant([f64::NAN; 4]), ..CAMERA };
        assert!(refusal(RgbdCalibration { color, ..good }).contains("distortion"));
    }

    #[test]
    fn odd_depths_lenses_and_sizes_do_no_harm() {
        // Polynomials that turn back at once, or have poles.
        let lenses = [
            PINHOLE,
            Distortion::RadialTangential([-9e3; 8]),
            Distortion::RadialTangential([0.0, 0.0, 9e3, -9e3, 0.0, -1.0, 0.0, 0.0]),
            Distortion::Equidistant([-5.0; 4]),
        ];
        for distortion in lenses {
            let camera = CameraIntrinsics { distortion, ..CAMERA };
            for from in [
                DepthMap::default(),
                map(1, 1, |_, _| 1.0),
                map(80, 60, |x, _| [f32::NAN, f32::INFINITY, -1.0, 1e-30, 1e30][x as usize % 5]),
            ] {
                let into = registered(RgbdCalibration::identity(camera), &from);
                assert!(into.metres.iter().all(|z_m| z_m.is_finite() && *z_m >= 0.0), "{distortion:?}");
            }
        }
    }
}
