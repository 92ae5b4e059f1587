//! The colour camera's picture, and the picture without distortion in which depth is drawn.

use glam::DVec2;

use crate::calibration::CameraIntrinsics;
use crate::frame::DepthMap;

/// Largest ratio of the undistorted picture's sides to those of the picture: a fisheye's rim is at infinity.
const MAX_GROWTH: f64 = 2.0;

/// Marks a pixel of the picture that is outside the undistorted one.
const NOWHERE: u32 = u32::MAX;

/// A pinhole camera with the axes of the colour camera.
#[derive(Debug)]
pub(super) struct View {
    /// Columns and rows of the undistorted picture.
    drawn_size: (u32, u32),
    /// Its focal lengths and principal point, in pixels.
    pub focal_px: DVec2,
    pub center_px: DVec2,
    /// Columns and rows of the colour camera's picture.
    size: (u32, u32),
    /// For each pixel of that picture the index of the undistorted one; `None` if both are the same.
    sources: Option<Vec<u32>>,
}

impl View {
    /// Computes the view of a camera of known size.
    pub fn new(camera: &CameraIntrinsics) -> Self {
        let size = camera.size.unwrap_or_default();
        let CameraIntrinsics { focal_px, center_px, .. } = *camera;
        if camera.distortion.is_none() {
            return Self { drawn_size: size, focal_px, center_px, size, sources: None };
        }
        let max_radius = camera.distortion.max_radius();
        let rays = (0..size.1).flat_map(|y| (0..size.0).map(move |x| DVec2::new(x.into(), y.into())));
        let rays: Vec<DVec2> = rays.map(|pixel_px| camera.unproject(pixel_px, max_radius) * focal_px).collect();
        // The rectangle of all rays, in pixels about the optical axis, as far as it may grow.
        let reach_px = crate::calibration::sides_px(size) * MAX_GROWTH / 2.0;
        let (mut low_px, mut high_px) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for ray in &rays {
            (low_px, high_px) = (low_px.min(*ray), high_px.max(*ray));
        }
        let low_px = low_px.max(-reach_px).floor();
        let extent_px = (high_px.min(reach_px).ceil() - low_px + 1.0).max(DVec2::ONE);
        let drawn_size = (extent_px.x as u32, extent_px.y as u32);
        let source = |ray: DVec2| {
            let place_px = (ray - low_px).round();
            let is_inside = place_px.cmpge(DVec2::ZERO).all() && place_px.cmplt(extent_px).all();
            if is_inside { place_px.y as u32 * drawn_size.0 + place_px.x as u32 } else { NOWHERE }
        };
        let sources = Some(rays.into_iter().map(source).collect());
        Self { drawn_size, focal_px, center_px: -low_px, size, sources }
    }

    /// Returns whether the undistorted picture is the camera's.
    pub fn is_picture(&self) -> bool {
        self.sources.is_none()
    }

    /// Returns columns and rows of the undistorted picture.
    pub fn drawn_size(&self) -> (u32, u32) {
        self.drawn_size
    }

    /// Takes the camera's picture from the undistorted one.
    pub fn distort(&self, drawn: &DepthMap, into: &mut DepthMap) {
        into.resize(self.size.0, self.size.1);
        for (metres, &source) in into.metres.iter_mut().zip(self.sources.iter().flatten()) {
            // Outside, nothing is known.
            *metres = drawn.metres.get(source as usize).copied().unwrap_or(0.0);
        }
    }
}
