//! Lens optics: from depth to the circle of confusion.
//!
//! A thin lens of focal length `f` and f-number `N`, focused at `z_f`, images a point at depth `z` as a disc of signed
//! radius `c(z) = c_inf (1 - z_f / z)`, where `c_inf = f^2 / (2 N (z_f - f))` divided by the pixel pitch is the radius
//! at infinity. Optionally a range of distances around `z_f` is sharp; the radius then grows from the nearer end of the
//! range.

/// A camera lens, described by the numbers on its barrel.
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
    /// Returns the CoC radius in pixels of a point at infinity when focused at `focus_m` on a picture `width_px` wide.
    /// A focus at or inside the focal length, where no image forms, is moved just outside it.
    pub fn coc_at_infinity_px(&self, focus_m: f32, width_px: u32) -> f32 {
        let focus_mm = (focus_m * 1000.0).max(self.focal_length_mm * 1.01);
        let radius_mm =
            self.focal_length_mm * self.focal_length_mm / (2.0 * self.f_number * (focus_mm - self.focal_length_mm));
        radius_mm * width_px as f32 / self.sensor_width_mm
    }
}

/// A rectified stereo pair of cameras: from disparity to depth, `z = f B / (d + doffs)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StereoRig {
    /// Focal length of the rectified pictures in pixels, > 0.
    pub focal_px: f32,
    /// Distance between the two cameras in metres, > 0.
    pub baseline_m: f32,
    /// Column of the right principal point minus that of the left, in pixels: the disparity at infinity is its
    /// negative.
    pub doffs_px: f32,
    /// True if the numbers are those of the cameras. Otherwise they are [`StereoRig::default_for_width`], and so are distances;
    /// the blur is equally good, because its CoC is affine in the disparity.
    pub metric: bool,
}

impl StereoRig {
    /// Returns a default rig for unknown cameras: baseline 60 mm, field of view 53 degrees.
    pub fn default_for_width(width_px: u32) -> Self {
        Self { focal_px: width_px as f32, baseline_m: 0.06, doffs_px: 0.0, metric: false }
    }

    /// Returns the depth in metres of a point with this disparity; infinite at or beyond infinity.
    #[inline(always)]
    pub fn depth_m(&self, disparity_px: f32) -> f32 {
        let above_px = disparity_px + self.doffs_px;
        if above_px > 0.0 { self.focal_px * self.baseline_m / above_px } else { f32::INFINITY }
    }

    /// Returns the disparity in pixels of a point at this depth, > 0 metres.
    #[inline(always)]
    pub fn disparity_px(&self, depth_m: f32) -> f32 {
        self.focal_px * self.baseline_m / depth_m - self.doffs_px
    }
}

/// Signed CoC radius of every pixel of a frame, as a rule that any executor can evaluate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CocField {
    /// Uniform radius (effect `blur`).
    Uniform {
        /// Radius in pixels, >= 0.
        radius_px: f32,
    },
    /// A band of focus across the picture, and a radius that grows linearly away from it (effect `tilt-shift`).
    Ramp(Ramp),
    /// The thin lens over a depth map (effect `dof`).
    Depth(DepthCoc),
}

/// Kind of a [`CocField`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CocKind {
    /// [`CocField::Uniform`].
    Uniform,
    /// [`CocField::Ramp`].
    Ramp,
    /// [`CocField::Depth`].
    Depth,
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
    /// Returns the CoC radius in pixels at the pixel centre (`x_px`, `y_px`).
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
    /// Width of the sharp range, centred on the focal plane, in metres, >= 0.
    pub range_m: f32,
    /// Largest `|c|`, in pixels: near points would otherwise grow without bound.
    pub max_coc_px: f32,
}

impl DepthCoc {
    /// Returns the near end of the sharp range, in metres, > 0: at least a tenth of the focal distance.
    #[inline(always)]
    pub fn near_m(&self) -> f32 {
        (self.focus_m - 0.5 * self.range_m).max(0.1 * self.focus_m)
    }

    /// Returns the far end of the sharp range, in metres.
    #[inline(always)]
    pub fn far_m(&self) -> f32 {
        self.focus_m + 0.5 * self.range_m
    }

    /// Returns the step of inverse depth, in 1/m, that changes the CoC by `px`; infinite if nothing is blurred.
    pub fn inverse_depth_step(&self, px: f32) -> f32 {
        px / (self.coc_at_infinity_px * self.focus_m)
    }

    /// Returns the signed CoC radius in pixels of a point at `depth_m`. Unknown depth counts as infinite, so that
    /// unmeasured pixels are blurred rather than shown.
    #[inline(always)]
    pub fn coc_px(&self, depth_m: f32) -> f32 {
        let inverse_m = if depth_m > 0.0 { 1.0 / depth_m } else { 0.0 };
        // 1 within the sharp range; outside, the end of the range whose ratio is nearer to 1.
        let (near, far) = (self.near_m() * inverse_m, self.far_m() * inverse_m);
        let far = if far < 1.0 { far } else { 1.0 };
        let ratio = if near > far { near } else { far };
        let coc_px = self.coc_at_infinity_px * (1.0 - ratio);
        let max_px = self.max_coc_px;
        // So that without a blur the smallest depths, whose inverse is infinite, are near, too, and not NaN.
        let coc_px = if coc_px > -max_px { coc_px } else { -max_px };
        if coc_px > max_px { max_px } else { coc_px }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thin_lens_laws() {
        let coc = DepthCoc { coc_at_infinity_px: 16.0, focus_m: 2.0, range_m: 0.0, max_coc_px: 40.0 };
        assert_eq!(coc.coc_px(2.0), 0.0);
        assert!(coc.coc_px(1.9) < 0.0 && coc.coc_px(2.1) > 0.0);
        assert_eq!(coc.coc_px(f32::INFINITY), 16.0);
        for unknown in [0.0, -1.0, f32::NAN] {
            assert_eq!(coc.coc_px(unknown), 16.0);
        }
        assert_eq!(coc.coc_px(1e-6), -40.0);
    }

    /// Distances from 0.1 mm to 10 km, logarithmically spaced.
    fn distances_m() -> impl Iterator<Item = f32> {
        (0..8000).map(|step| 1e-4 * 10f32.powf(step as f32 * 1e-3))
    }

    #[test]
    fn without_a_range_every_radius_is_that_of_the_plain_formula_to_the_bit() {
        for focus_m in [0.03, 0.7, 1.0, 2.3, 11.7, 1e4] {
            let coc = DepthCoc { coc_at_infinity_px: 16.3, focus_m, range_m: 0.0, max_coc_px: 40.1 };
            let odd_m = [0.0, -1.0, f32::NAN, f32::INFINITY, f32::MIN_POSITIVE, 1e-40, f32::MAX, focus_m];
            for depth_m in distances_m().chain(odd_m) {
                let inverse_m = if depth_m > 0.0 { 1.0 / depth_m } else { 0.0 };
                let plain_px = (16.3f32 * (1.0 - focus_m * inverse_m)).clamp(-40.1, 40.1);
                assert_eq!(coc.coc_px(depth_m).to_bits(), plain_px.to_bits(), "{focus_m} m, {depth_m} m");
            }
        }
    }

    #[test]
    fn all_within_the_range_is_sharp_and_the_radius_grows_from_its_ends() {
        for (focus_m, range_m) in [(2.0, 0.5), (1.0, 1.5), (1.0, 30.0), (0.4, 0.01)] {
            let coc = DepthCoc { coc_at_infinity_px: 16.0, focus_m, range_m, max_coc_px: 40.0 };
            let (near_m, far_m) = (coc.near_m(), coc.far_m());
            assert!(near_m >= 0.1 * focus_m && near_m < focus_m && (far_m - focus_m - range_m / 2.0).abs() < 1e-6);
            let mut before_px = -40.0;
            for depth_m in distances_m() {
                let coc_px = coc.coc_px(depth_m);
                assert!(coc_px >= before_px, "the radius falls at {depth_m} m");
                // One step is 0.23 % of the distance, and changes the CoC by no more than that times the slope.
                assert!(coc_px - before_px < 40.0 * 0.0024 + 16.0 * 0.0024, "the radius jumps at {depth_m} m");
                match depth_m {
                    _ if depth_m < 0.9999 * near_m => assert!(coc_px < 0.0),
                    _ if depth_m > 1.0001 * far_m => assert!(coc_px > 0.0),
                    _ if depth_m > 1.0001 * near_m && depth_m < 0.9999 * far_m => assert_eq!(coc_px, 0.0),
                    _ => assert!(coc_px.abs() < 0.01),
                }
                before_px = coc_px;
            }
            assert_eq!(coc.coc_px(f32::INFINITY), 16.0);
            assert_eq!(coc.coc_px(f32::NAN), 16.0);
        }
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
