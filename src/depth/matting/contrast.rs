//! Colour contrast of two surfaces: alpha of a colour between them, and the colours that make up a mixed pixel.
//! twin: shaders/matte/contrast.wgsl, matte/mix.wgsl

#![allow(clippy::needless_range_loop)] // Planes and pixels index several arrays at once.

use super::alpha::{LANES, Lanes};
use super::symmetric::{Symmetric, dot, invert, multiply, outer_product};
use super::{fast_max, fast_min};

/// Isotropic part of regularised covariances: those of few pixels are too narrow.
pub(super) const SHRINKAGE: f32 = 0.01;
/// Variance of the quantisation to 8 bits, in linear light.
pub(super) const QUANTISATION: f32 = 5e-6;
/// Maximum Mahalanobis distance, in standard deviations, of light from a surface that may have it.
pub(super) const MAX_DEVIATION: f32 = 3.0;

/// Maximum reciprocal variance of alpha, since colours are quantised.
pub(super) const MAX_PRECISION: f32 = 1000.0;

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

    /// Creates the discriminant of a [`Contrast::foreground_params`] against the background `light`.
    #[inline(always)]
    pub fn against_background([x, y, z, a, b, c, d, e, f]: [f32; FOREGROUND_PARAMS], light: [f32; 3]) -> Self {
        Self::new([x, y, z], &[a, b, c, d, e, f], light)
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

    /// Returns the discriminant of both surfaces, or of the near one and a known background.
    #[inline(always)]
    pub(super) fn discriminant(&self, background: Option<[f32; 3]>) -> Discriminant {
        match background {
            Some(light) => Discriminant::against_background(self.foreground_params(), light),
            None => self.discriminant,
        }
    }

    /// Whether the light is plausible for the far surface.
    #[inline(always)]
    pub(super) fn is_plausible_far(&self, light: [f32; 3]) -> bool {
        let mean = &self.surfaces[1].mean;
        let off = std::array::from_fn(|p| light[p] - mean[p]);
        dot(off, multiply(&self.of_far, off)) < MAX_DEVIATION * MAX_DEVIATION
    }

    /// Returns the squared Mahalanobis distance of a colour to the line between the near surface and the background
    /// `light`, at `alpha`.
    #[inline(always)]
    pub(super) fn off_line_distance(&self, light: [f32; 3], own: [f32; 3], alpha: f32) -> f32 {
        let near = &self.surfaces[0].mean;
        let alpha = alpha.clamp(0.0, 1.0);
        let off = std::array::from_fn(|p| own[p] - light[p] - alpha * (near[p] - light[p]));
        dot(off, multiply(&self.inverse, off))
    }

    /// Returns both colours; a known background light replaces the far one's mean, and its covariance stays for noise.
    #[inline(always)]
    pub(super) fn colors_with_background(&self, light: Option<[f32; 3]>) -> [Color; 2] {
        let [near, far] = self.surfaces;
        [near, Color { mean: light.unwrap_or(far.mean), ..far }]
    }
}

/// Computes the near colour minus the far colour of a mixed pixel: the most likely pair that adds up to the pixel's
/// `own` colour (Chuang et al. 2001, equation 9, without the noise term). Clamped so that neither is darker than black
/// or brighter than white.
#[inline(always)]
fn color_difference(near: &Color, far: &Color, own: [f32; 3], alpha: f32) -> [f32; 3] {
    let rest = 1.0 - alpha;
    let (mut spread, mut residual) = ([0.0; 6], [0.0; 3]);
    for k in 0..6 {
        spread[k] = alpha * alpha * near.covariance[k] + rest * rest * far.covariance[k];
    }
    for p in 0..3 {
        residual[p] = own[p] - alpha * near.mean[p] - rest * far.mean[p];
    }
    let step = multiply(&invert(&regularize(spread)), residual);
    let (of_near, of_far) = (multiply(&near.covariance, step), multiply(&far.covariance, step));
    let (up, down) = (fast_max(rest, 1e-3), fast_max(alpha, 1e-3));
    let mut differences = [0.0; 3];
    for p in 0..3 {
        let difference = near.mean[p] + alpha * of_near[p] - far.mean[p] - rest * of_far[p];
        let most = fast_min((1.0 - own[p]) / up, own[p] / down);
        let least = -fast_min(own[p] / up, (1.0 - own[p]) / down);
        differences[p] = fast_min(fast_max(difference, fast_min(least, 0.0)), fast_max(most, 0.0));
    }
    differences
}

/// Several pixels and their surfaces, as a structure of arrays.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct MixedBatch {
    means: [[Lanes; 3]; 2],
    covariances: [[Lanes; 6]; 2],
    own: [Lanes; 3],
    alpha: Lanes,
}

impl MixedBatch {
    /// Sets lane `k`.
    #[inline(always)]
    pub fn set_lane(&mut self, k: usize, surfaces: [Color; 2], own: [f32; 3], alpha: f32) {
        for n in 0..2 {
            for p in 0..3 {
                self.means[n][p][k] = surfaces[n].mean[p];
            }
            for p in 0..6 {
                self.covariances[n][p][k] = surfaces[n].covariance[p];
            }
        }
        for p in 0..3 {
            self.own[p][k] = own[p];
        }
        self.alpha[k] = alpha;
    }

    /// Computes [`color_difference`] of all lanes.
    #[inline(always)]
    pub fn color_differences(&self) -> [Lanes; 3] {
        let mut differences = [[0.0; LANES]; 3];
        for k in 0..LANES {
            let ([near, far], [of_near, of_far]) = (&self.means, &self.covariances);
            let mean = |mean: &[Lanes; 3]| [mean[0][k], mean[1][k], mean[2][k]];
            let color = |of: &[Lanes; 3], with: &[Lanes; 6]| Color {
                mean: mean(of),
                covariance: [with[0][k], with[1][k], with[2][k], with[3][k], with[4][k], with[5][k]],
            };
            let of_one = color_difference(&color(near, of_near), &color(far, of_far), mean(&self.own), self.alpha[k]);
            for p in 0..3 {
                differences[p][k] = of_one[p];
            }
        }
        differences
    }
}

/// Adds an isotropic part to a covariance.
#[inline(always)]
fn regularize(mut spread: Symmetric) -> Symmetric {
    let floor = SHRINKAGE / 3.0 * (spread[0] + spread[3] + spread[5]) + QUANTISATION;
    for k in [0, 3, 5] {
        spread[k] += floor;
    }
    spread
}
