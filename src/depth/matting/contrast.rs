//! Colour contrast of two surfaces: alpha of a colour between them, and the colours that make up a mixed pixel.
//! twin: shaders/matte_contrast.wgsl, matte_mix.wgsl

#![allow(clippy::needless_range_loop)] // Planes and pixels index several arrays at once.

use super::clusters::Color;
use super::share::{LANES, Lanes};
use super::symmetric::{Symmetric, dot, inverse, times};
use super::{larger, smaller};

/// Isotropic part of regularised covariances: those of few pixels are too narrow.
pub(super) const SHRINKAGE: f32 = 0.01;
/// Variance of the quantisation to 8 bits, in linear light.
pub(super) const QUANTISATION: f32 = 5e-6;
/// Maximum Mahalanobis distance, in standard deviations, of light from a surface that may have it.
pub(super) const MAX_DEVIATION: f32 = 3.0;

/// Maximum reciprocal variance of alpha, since colours are quantised.
pub(super) const MAX_PRECISION: f32 = 1000.0;

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

/// Lengths of [`Contrast::line`] and of [`Contrast::front`].
pub(super) const LINE: usize = 5;
pub(super) const FRONT: usize = 9;

impl Discriminant {
    #[inline(always)]
    fn new(near: [f32; 3], inverse: &Symmetric, far: [f32; 3]) -> Self {
        let difference: [f32; 3] = std::array::from_fn(|p| near[p] - far[p]);
        let direction = times(inverse, difference);
        let contrast = dot(direction, difference).max(1e-9);
        let scale = 1.0 / contrast;
        let direction = direction.map(|value| scale * value);
        // The scatter has the variances of both surfaces; a mixed pixel has half of each.
        Self { direction, offset: dot(direction, far), precision: (2.0 * contrast).min(MAX_PRECISION) }
    }

    /// Creates the discriminant of a [`Contrast::front`] against the background `light`.
    #[inline(always)]
    pub fn before([x, y, z, a, b, c, d, e, f]: [f32; FRONT], light: [f32; 3]) -> Self {
        Self::new([x, y, z], &[a, b, c, d, e, f], light)
    }

    /// Returns alpha of a colour, from below 0 to above 1.
    #[inline(always)]
    pub fn alpha(&self, color: [f32; 3]) -> f32 {
        dot(self.direction, color) - self.offset
    }
}

impl From<[f32; LINE]> for Discriminant {
    /// Restores the discriminant of a [`Contrast::line`].
    #[inline(always)]
    fn from([x, y, z, offset, precision]: [f32; LINE]) -> Self {
        Self { direction: [x, y, z], offset, precision }
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
        let inverse = self::inverse(&spread);
        let discriminant = Discriminant::new(near.mean, &inverse, far.mean);
        let of_far = self::inverse(&widened(far.covariance));
        Self { surfaces, discriminant, inverse, of_far }
    }

    /// Returns the parameters of the [`Discriminant`]; interpolated ones are those of a surface in between.
    #[inline(always)]
    pub(super) fn line(&self) -> [f32; LINE] {
        let Discriminant { direction: [x, y, z], offset, precision } = self.discriminant;
        [x, y, z, offset, precision]
    }

    /// Returns the parameters for a known background, for [`Discriminant::before`].
    #[inline(always)]
    pub(super) fn front(&self) -> [f32; FRONT] {
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
    pub(super) fn discriminant(&self, behind: Option<[f32; 3]>) -> Discriminant {
        match behind {
            Some(light) => Discriminant::before(self.front(), light),
            None => self.discriminant,
        }
    }

    /// Whether the light is plausible for the far surface.
    #[inline(always)]
    pub(super) fn is_like_far(&self, light: [f32; 3]) -> bool {
        let mean = &self.surfaces[1].mean;
        let off = std::array::from_fn(|p| light[p] - mean[p]);
        dot(off, times(&self.of_far, off)) < MAX_DEVIATION * MAX_DEVIATION
    }

    /// Returns the squared Mahalanobis distance of a colour to the line between the near surface and the background
    /// `light`, at `alpha`.
    #[inline(always)]
    pub(super) fn off_line(&self, light: [f32; 3], own: [f32; 3], alpha: f32) -> f32 {
        let near = &self.surfaces[0].mean;
        let alpha = alpha.clamp(0.0, 1.0);
        let off = std::array::from_fn(|p| own[p] - light[p] - alpha * (near[p] - light[p]));
        dot(off, times(&self.inverse, off))
    }

    /// Returns both colours; a known background light replaces the far one's mean, and its covariance stays for noise.
    #[inline(always)]
    pub(super) fn before(&self, light: Option<[f32; 3]>) -> [Color; 2] {
        let [near, far] = self.surfaces;
        [near, Color { mean: light.unwrap_or(far.mean), ..far }]
    }
}

/// Computes the near colour minus the far colour of a mixed pixel: the most likely pair that adds up to the pixel's
/// `own` colour (Chuang et al. 2001, equation 9, without the noise term). Clamped so that neither is darker than black
/// or brighter than white.
#[inline(always)]
pub(super) fn difference(near: &Color, far: &Color, own: [f32; 3], alpha: f32) -> [f32; 3] {
    let rest = 1.0 - alpha;
    let (mut spread, mut residual) = ([0.0; 6], [0.0; 3]);
    for k in 0..6 {
        spread[k] = alpha * alpha * near.covariance[k] + rest * rest * far.covariance[k];
    }
    for p in 0..3 {
        residual[p] = own[p] - alpha * near.mean[p] - rest * far.mean[p];
    }
    let step = times(&inverse(&widened(spread)), residual);
    let (of_near, of_far) = (times(&near.covariance, step), times(&far.covariance, step));
    let (up, down) = (larger(rest, 1e-3), larger(alpha, 1e-3));
    let mut differences = [0.0; 3];
    for p in 0..3 {
        let difference = near.mean[p] + alpha * of_near[p] - far.mean[p] - rest * of_far[p];
        let most = smaller((1.0 - own[p]) / up, own[p] / down);
        let least = -smaller(own[p] / up, (1.0 - own[p]) / down);
        differences[p] = smaller(larger(difference, smaller(least, 0.0)), larger(most, 0.0));
    }
    differences
}

/// Several pixels and their surfaces, as a structure of arrays.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Parts {
    means: [[Lanes; 3]; 2],
    covariances: [[Lanes; 6]; 2],
    own: [Lanes; 3],
    alpha: Lanes,
}

impl Parts {
    /// Sets lane `k`.
    #[inline(always)]
    pub fn set(&mut self, k: usize, surfaces: [Color; 2], own: [f32; 3], alpha: f32) {
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

    /// Computes [`difference`] of all lanes.
    #[inline(always)]
    pub fn differences(&self) -> [Lanes; 3] {
        let mut differences = [[0.0; LANES]; 3];
        for k in 0..LANES {
            let ([near, far], [of_near, of_far]) = (&self.means, &self.covariances);
            let mean = |mean: &[Lanes; 3]| [mean[0][k], mean[1][k], mean[2][k]];
            let color = |of: &[Lanes; 3], with: &[Lanes; 6]| Color {
                mean: mean(of),
                covariance: [with[0][k], with[1][k], with[2][k], with[3][k], with[4][k], with[5][k]],
            };
            let of_one = difference(&color(near, of_near), &color(far, of_far), mean(&self.own), self.alpha[k]);
            for p in 0..3 {
                differences[p][k] = of_one[p];
            }
        }
        differences
    }
}

/// Adds an isotropic part to a covariance.
#[inline(always)]
fn widened(mut spread: Symmetric) -> Symmetric {
    let floor = SHRINKAGE / 3.0 * (spread[0] + spread[3] + spread[5]) + QUANTISATION;
    for k in [0, 3, 5] {
        spread[k] += floor;
    }
    spread
}
