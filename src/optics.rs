//! The lens: from depth to the circle of confusion.
//!
//! A thin lens of focal length `f` and f-number `N`, focused at `z_f`, images a point at depth `z` as a disc of
//! signed radius `c(z) = c_inf (1 - z_f / z)`, where `c_inf = f^2 / (2 N (z_f - f))` divided by the pixel pitch
//! is the radius at infinity.

/// A camera lens in the terms on its barrel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Focal length in millimetres, > 0.
    pub focal_length_mm: f32,
    /// f-number: focal length over aperture diameter, > 0.
    pub f_number: f32,
    /// Width of the sensor in millimetres, > 0; the picture's width covers it.
    pub sensor_width_mm: f32,
}

impl Lens {
    /// CoC radius in pixels of a point at infinity when focused at `focus_m` on a picture `width_px` wide.
    /// A focus at or inside the focal length, where no image forms, is taken as just outside it.
    pub fn coc_at_infinity_px(&self, focus_m: f32, width_px: u32) -> f32 {
        let focus_mm = (focus_m * 1000.0).max(self.focal_length_mm * 1.01);
        let radius_mm =
            self.focal_length_mm * self.focal_length_mm / (2.0 * self.f_number * (focus_mm - self.focal_length_mm));
        radius_mm * width_px as f32 / self.sensor_width_mm
    }
}

/// Two parallel eyes of one focal length: from disparity to depth, `z = f B / (d + doffs)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StereoRig {
    /// Focal length of the rectified pictures in pixels, > 0.
    pub focal_px: f32,
    /// Distance of the eyes in metres, > 0.
    pub baseline_m: f32,
    /// Column of the right principal point less that of the left, in pixels: the disparity of infinity is its negative.
    pub doffs_px: f32,
    /// Whether the numbers are those of the cameras. Otherwise they are [`StereoRig::assumed`], and so are distances:
    /// the blur, whose CoC is affine in the disparity, is none the worse for it.
    pub metric: bool,
}

impl StereoRig {
    /// Eyes 60 mm apart that see 53 degrees, of which nothing is known.
    pub fn assumed(width_px: u32) -> Self {
        Self { focal_px: width_px as f32, baseline_m: 0.06, doffs_px: 0.0, metric: false }
    }

    /// Depth in metres of a point with this disparity; infinite at or beyond infinity.
    #[inline(always)]
    pub fn depth_m(&self, disparity_px: f32) -> f32 {
        let above_px = disparity_px + self.doffs_px;
        if above_px > 0.0 { self.focal_px * self.baseline_m / above_px } else { f32::INFINITY }
    }

    /// Disparity in pixels of a point at this depth, > 0 metres.
    #[inline(always)]
    pub fn disparity_px(&self, depth_m: f32) -> f32 {
        self.focal_px * self.baseline_m / depth_m - self.doffs_px
    }
}

/// The signed CoC radius of every pixel of a frame, as a rule that any executor can evaluate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CocField {
    /// The same radius everywhere (effect `blur`).
    Uniform {
        /// Radius in pixels, >= 0.
        radius_px: f32,
    },
    /// A band of focus across the picture, and a radius that grows linearly away from it (effect `tilt-shift`).
    Ramp(Ramp),
    /// The thin lens over a depth map (effect `dof`).
    Depth(DepthCoc),
}

/// Tilt-shift: the radius is `slope * (distance of the pixel from the band)`, at most `max_px`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ramp {
    /// Unit normal of the band, in pixels (x right, y down).
    pub normal: glam::Vec2,
    /// `normal . p` on the middle line of the band, in pixels.
    pub offset_px: f32,
    /// Half the width of the sharp band, in pixels.
    pub half_band_px: f32,
    /// Radius gained per pixel of distance.
    pub slope: f32,
    /// Largest radius, in pixels.
    pub max_px: f32,
}

impl Ramp {
    /// CoC radius in pixels at the pixel centre (`x_px`, `y_px`).
    #[inline(always)]
    pub fn coc_px(&self, x_px: f32, y_px: f32) -> f32 {
        let distance_px = (self.normal.x * x_px + self.normal.y * y_px - self.offset_px).abs() - self.half_band_px;
        (distance_px.max(0.0) * self.slope).min(self.max_px)
    }
}

/// The thin lens over depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthCoc {
    /// Radius of a point at infinity, in pixels, >= 0.
    pub coc_at_infinity_px: f32,
    /// Distance of the focal plane, in metres, > 0.
    pub focus_m: f32,
    /// `|c|` is cut here, in pixels: near points would otherwise grow without bound.
    pub max_coc_px: f32,
}

impl DepthCoc {
    /// Signed CoC radius in pixels of a point at `depth_m`; unknown depth counts as infinitely far, so that what
    /// nobody measured is blurred rather than shown.
    #[inline(always)]
    pub fn coc_px(&self, depth_m: f32) -> f32 {
        let inverse_m = if depth_m > 0.0 { 1.0 / depth_m } else { 0.0 };
        let coc_px = self.coc_at_infinity_px * (1.0 - self.focus_m * inverse_m);
        let most_px = self.max_coc_px;
        let coc_px = if coc_px < -most_px { -most_px } else { coc_px };
        if coc_px > most_px { most_px } else { coc_px }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thin_lens_laws() {
        let coc = DepthCoc { coc_at_infinity_px: 16.0, focus_m: 2.0, max_coc_px: 40.0 };
        assert_eq!(coc.coc_px(2.0), 0.0);
        assert!(coc.coc_px(1.9) < 0.0 && coc.coc_px(2.1) > 0.0);
        assert_eq!(coc.coc_px(f32::INFINITY), 16.0);
        for unknown in [0.0, -1.0, f32::NAN] {
            assert_eq!(coc.coc_px(unknown), 16.0);
        }
        assert_eq!(coc.coc_px(1e-6), -40.0);
    }

    #[test]
    fn a_lens_by_its_numbers_agrees_with_the_formula() {
        // 50 mm f/2 at 2 m on a 36 mm wide sensor of 1920 px: 2500 / (4 * 1950) mm = 17.09 px.
        let lens = Lens { focal_length_mm: 50.0, f_number: 2.0, sensor_width_mm: 36.0 };
        assert!((lens.coc_at_infinity_px(2.0, 1920) - 17.094).abs() < 1e-2);
        assert!(lens.coc_at_infinity_px(0.001, 1920).is_finite());
    }

    #[test]
    fn the_ramp_is_sharp_in_its_band_and_capped() {
        let ramp = Ramp { normal: glam::Vec2::Y, offset_px: 100.0, half_band_px: 10.0, slope: 0.1, max_px: 5.0 };
        assert_eq!(ramp.coc_px(3.0, 105.0), 0.0);
        assert!((ramp.coc_px(3.0, 130.0) - 2.0).abs() < 1e-6);
        assert_eq!(ramp.coc_px(3.0, 1000.0), 5.0);
    }
}
