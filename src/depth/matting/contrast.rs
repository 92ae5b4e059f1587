//! Colour contrast of two surfaces: alpha of a colour between them.
//! twin: shaders/matte/contrast.wgsl

use super::symmetric::{Symmetric, dot, invert, multiply, outer_product};

/// Isotropic part of regularised covariances: those of few pixels are too narrow.
pub(super) const SHRINKAGE: f32 = 0.01;
/// Variance of the quantisation to 8 bits, in linear light.
pub(super) const QUANTISATION: f32 = 5e-6;
/// Maximum Mahalanobis distance, in standard deviations, of light from a surface that may have it.
pub(super) const MAX_DEVIATION: f32 = 3.0;

/// Maximum reciprocal variance of alpha, since colours are quantised.
pub(super) const MAX_PRECISION: f32 = 1000.0;

/// Variance of the light of a near surface without pixels around, and the weight of pixels that halves it.
pub(super) const UNCERTAINTY: f32 = 0.003;
pub(super) const UNCERTAIN_WEIGHT: f32 = 1e-3;

/// Mean and covariance of a surface's colours in linear light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Color {
    pub mean: [f32; 3],
    pub covariance: Symmetric,
}

impl Color {
    /// Computes mean and covariance from the total weight, and the weighted sums of the light and of its products.
    #[inline(always)]
    pub(super) fn from_sums(weight: f32, light: [f32; 3], squares: Symmetric) -> Self {
        let mean = light.map(|light| light / weight);
        let of_mean = outer_product(mean);
        Self { mean, covariance: std::array::from_fn(|k| squares[k] / weight - of_mean[k]) }
    }

    /// Adds the uncertainty of a colour that was found with this total weight: at hair, whose surface has its pure
    /// pixels far away, it may be another one.
    #[inline(always)]
    pub(super) fn with_uncertainty(self, weight: f32) -> Self {
        let Self { mean, mut covariance } = self;
        let variance = UNCERTAINTY * (UNCERTAIN_WEIGHT / (UNCERTAIN_WEIGHT + weight));
        for k in [0, 3, 5] {
            covariance[k] += variance;
        }
        Self { mean, covariance }
    }
}

/// Colours of two surfaces, and how well they can be separated.
#[derive(Clone, Copy, Debug)]
pub struct Contrast {
    /// Colours of the near and of the far surface.
    surfaces: [Color; 2],
    discriminant: Discriminant,
    /// Inverse of the within-class scatter (sum of both covariances), and of the far surface's covariance.
    inverse: Symmetric,
    of_far: Symmetric,
}

/// Fisher's linear discriminant between the colours of two surfaces: alpha is the dot product of a colour and
/// `direction`, less `offset`; `precision` is the reciprocal variance of alpha within one surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Discriminant {
    direction: [f32; 3],
    offset: f32,
    pub precision: f32,
}

/// Lengths of [`Contrast::discriminant_params`], of [`Contrast::surface_params`], and of
/// [`Contrast::foreground_params`].
const DISCRIMINANT_PARAMS: usize = 5;
const SURFACE_PARAMS: usize = 8;
const FOREGROUND_PARAMS: usize = 9;

impl Discriminant {
    #[inline(always)]
    fn new(near: [f32; 3], inverse: &Symmetric, far: [f32; 3]) -> Self {
        let difference: [f32; 3] = std::array::from_fn(|p| near[p] - far[p]);
        let direction = multiply(inverse, difference);
        let contrast = dot(direction, difference).max(1e-9);
        let scale = 1.0 / contrast;
        let direction = direction.map(|value| scale * value);
        // The scatter has the variances of both surfaces; a mixed pixel has half of each.
        Self { direction, offset: dot(direction, far), precision: (2.0 * contrast).min(MAX_PRECISION) }
    }

    /// Returns alpha of a colour, from below 0 to above 1.
    #[inline(always)]
    pub fn alpha(&self, color: [f32; 3]) -> f32 {
        dot(self.direction, color) - self.offset
    }
}

impl Contrast {
    /// Computes the contrast of the near and the far surface's colours.
    #[inline(always)]
    pub(super) fn new(surfaces: [Color; 2]) -> Self {
        let [near, far] = &surfaces;
        let mut spread: Symmetric = std::array::from_fn(|k| near.covariance[k] + far.covariance[k]);
        let trace = spread[0] + spread[3] + spread[5];
        spread = spread.map(|value| (1.0 - SHRINKAGE) * value);
        for k in [0, 3, 5] {
            spread[k] += SHRINKAGE / 3.0 * trace + QUANTISATION;
        }
        let inverse = invert(&spread);
        let discriminant = Discriminant::new(near.mean, &inverse, far.mean);
        let of_far = invert(&regularize(far.covariance));
        Self { surfaces, discriminant, inverse, of_far }
    }

    /// Returns the parameters of the [`Discriminant`]; interpolated ones are those of a surface in between.
    #[inline(always)]
    pub(super) fn discriminant_params(&self) -> [f32; DISCRIMINANT_PARAMS] {
        let Discriminant { direction: [x, y, z], offset, precision } = self.discriminant;
        [x, y, z, offset, precision]
    }

    /// Returns the means of the near and of the far surface's colours, and their mean variances.
    #[inline(always)]
    pub(super) fn surface_params(&self) -> [f32; SURFACE_PARAMS] {
        let [near, far] = &self.surfaces;
        let ([a, b, c], [d, e, f]) = (near.mean, far.mean);
        let variance = |color: &Color| (color.covariance[0] + color.covariance[3] + color.covariance[5]) / 3.0;
        [a, b, c, d, e, f, variance(near), variance(far)]
    }

    /// Returns the parameters for a known background, for [`Discriminant::against_background`].
    #[inline(always)]
    pub(super) fn foreground_params(&self) -> [f32; FOREGROUND_PARAMS] {
        let ([x, y, z], [a, b, c, d, e, f]) = (self.surfaces[0].mean, self.inverse);
        [x, y, z, a, b, c, d, e, f]
    }

    /// See [`Discriminant::alpha`].
    #[inline(always)]
    pub(super) fn alpha(&self, color: [f32; 3]) -> f32 {
        self.discriminant.alpha(color)
    }

    /// Whether the light is plausible for the far surface.
    #[inline(always)]
    pub(super) fn is_plausible_far(&self, light: [f32; 3]) -> bool {
        let mean = &self.surfaces[1].mean;
        let off = std::array::from_fn(|p| light[p] - mean[p]);
        dot(off, multiply(&self.of_far, off)) < MAX_DEVIATION * MAX_DEVIATION
    }

    /// Returns both colours; a known background light replaces the far one's mean, and its covariance stays for noise.
    #[inline(always)]
    pub(super) fn colors_with_background(&self, light: Option<[f32; 3]>) -> [Color; 2] {
        let [near, far] = self.surfaces;
        [near, Color { mean: light.unwrap_or(far.mean), ..far }]
    }
}

/// Adds an isotropic part to a covariance.
#[inline(always)]
pub(super) fn regularize(mut spread: Symmetric) -> Symmetric {
    let floor = SHRINKAGE / 3.0 * (spread[0] + spread[3] + spread[5]) + QUANTISATION;
    for k in [0, 3, 5] {
        spread[k] += floor;
    }
    spread
}
