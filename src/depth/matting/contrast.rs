//! How the colours of two surfaces differ, and which of them a mixed pixel is made of.

#![allow(clippy::needless_range_loop)] // Planes and pixels index several arrays at once.

use super::clusters::Color;
use super::share::{LANES, Lanes};
use super::symmetric::{Symmetric, dot, inverse, times};
use super::{larger, smaller};

/// Covariances of few pixels are too narrow: so much of them goes evenly into all directions.
pub(super) const SHRINKAGE: f32 = 0.01;
/// Variance of what quantisation alone does, in linear light.
pub(super) const QUANTISATION: f32 = 5e-6;
/// Light that is off a surface's by more than so many standard deviations is not of it.
pub(super) const MOST_DEVIATION: f32 = 3.0;

/// No share is more precise, as colours are in steps.
pub(super) const MOST_PRECISION: f32 = 1000.0;

/// How the colours of two surfaces differ, for how much they vary.
#[derive(Clone, Copy, Debug)]
pub struct Contrast {
    /// Of the near and of the far surface.
    surfaces: [Color; 2],
    discriminant: Discriminant,
    /// The inverse of the covariance that both surfaces' colours vary by, and of the far surface's own.
    inverse: Symmetric,
    of_far: Symmetric,
}

/// Fisher's linear discriminant between the colours of two surfaces: a colour's product with `direction`, less `offset`, is the
/// share of the near one, and `precision` the reciprocal variance of that over the pixels of one surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Discriminant {
    direction: [f32; 3],
    offset: f32,
    pub precision: f32,
}

/// Numbers of [`Contrast::line`], and of [`Contrast::front`].
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
        // Both surfaces' variances are in it, of which a mixed pixel has half each.
        Self { direction, offset: dot(direction, far), precision: (2.0 * contrast).min(MOST_PRECISION) }
    }

    /// Of a [`Contrast::front`] before this light.
    #[inline(always)]
    pub fn before([x, y, z, a, b, c, d, e, f]: [f32; FRONT], light: [f32; 3]) -> Self {
        Self::new([x, y, z], &[a, b, c, d, e, f], light)
    }

    /// The share of the near surface that a colour is, from below 0 to above 1.
    #[inline(always)]
    pub fn share(&self, color: [f32; 3]) -> f32 {
        dot(self.direction, color) - self.offset
    }
}

impl From<[f32; LINE]> for Discriminant {
    /// Of a [`Contrast::line`].
    #[inline(always)]
    fn from([x, y, z, offset, precision]: [f32; LINE]) -> Self {
        Self { direction: [x, y, z], offset, precision }
    }
}

impl Contrast {
    /// Of the colours of the near and of the far surface.
    #[inline(always)]
    pub(super) fn of(surfaces: [Color; 2]) -> Self {
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

    /// The numbers of a [`Discriminant`]; what lies between two of them does so between their surfaces.
    #[inline(always)]
    pub(super) fn line(&self) -> [f32; LINE] {
        let Discriminant { direction: [x, y, z], offset, precision } = self.discriminant;
        [x, y, z, offset, precision]
    }

    /// The same before light that is known, for [`Discriminant::before`].
    #[inline(always)]
    pub(super) fn front(&self) -> [f32; FRONT] {
        let ([x, y, z], [a, b, c, d, e, f]) = (self.surfaces[0].mean, self.inverse);
        [x, y, z, a, b, c, d, e, f]
    }

    /// See [`Discriminant::share`].
    #[inline(always)]
    pub(super) fn share(&self, color: [f32; 3]) -> f32 {
        self.discriminant.share(color)
    }

    /// That of both surfaces, or of the near one before this light.
    #[inline(always)]
    pub(super) fn discriminant(&self, behind: Option<[f32; 3]>) -> Discriminant {
        match behind {
            Some(light) => Discriminant::before(self.front(), light),
            None => self.discriminant,
        }
    }

    /// Whether the far surface may have this light here.
    #[inline(always)]
    pub(super) fn is_like_far(&self, light: [f32; 3]) -> bool {
        let mean = &self.surfaces[1].mean;
        let off = std::array::from_fn(|p| light[p] - mean[p]);
        dot(off, times(&self.of_far, off)) < MOST_DEVIATION * MOST_DEVIATION
    }

    /// How far a colour that is a `share` of the near surface before this light is off the line between both: a squared distance,
    /// in standard deviations of what both vary by.
    #[inline(always)]
    pub(super) fn off_line(&self, light: [f32; 3], own: [f32; 3], share: f32) -> f32 {
        let near = &self.surfaces[0].mean;
        let share = share.clamp(0.0, 1.0);
        let off = std::array::from_fn(|p| own[p] - light[p] - share * (near[p] - light[p]));
        dot(off, times(&self.inverse, off))
    }

    /// Both surfaces, of which the far one has this light here, but for noise, where that is known.
    #[inline(always)]
    pub(super) fn before(&self, light: Option<[f32; 3]>) -> [Color; 2] {
        let [near, far] = self.surfaces;
        [near, Color { mean: light.unwrap_or(far.mean), ..far }]
    }
}

/// Colour of the near surface less that of the far one, for a pixel of which the near one has a share: the most likely
/// ones of those that add up to the pixel's `own` (Chuang et al. 2001, equation 9, with the pixel as exact). None is
/// darker than black, or brighter than white.
#[inline(always)]
pub(super) fn difference(near: &Color, far: &Color, own: [f32; 3], share: f32) -> [f32; 3] {
    let rest = 1.0 - share;
    let (mut spread, mut residual) = ([0.0; 6], [0.0; 3]);
    for k in 0..6 {
        spread[k] = share * share * near.covariance[k] + rest * rest * far.covariance[k];
    }
    for p in 0..3 {
        residual[p] = own[p] - share * near.mean[p] - rest * far.mean[p];
    }
    let step = times(&inverse(&widened(spread)), residual);
    let (of_near, of_far) = (times(&near.covariance, step), times(&far.covariance, step));
    let (up, down) = (larger(rest, 1e-3), larger(share, 1e-3));
    let mut differences = [0.0; 3];
    for p in 0..3 {
        let difference = near.mean[p] + share * of_near[p] - far.mean[p] - rest * of_far[p];
        let most = smaller((1.0 - own[p]) / up, own[p] / down);
        let least = -smaller(own[p] / up, (1.0 - own[p]) / down);
        differences[p] = smaller(larger(difference, smaller(least, 0.0)), larger(most, 0.0));
    }
    differences
}

/// Some pixels and their surfaces, a number of all of them after the other: means, covariances, light, shares.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Parts {
    means: [[Lanes; 3]; 2],
    covariances: [[Lanes; 6]; 2],
    own: [Lanes; 3],
    share: Lanes,
}

impl Parts {
    /// Replaces one.
    #[inline(always)]
    pub fn set(&mut self, k: usize, surfaces: [Color; 2], own: [f32; 3], share: f32) {
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
        self.share[k] = share;
    }

    /// [`difference`] of all.
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
            let of_one = difference(&color(near, of_near), &color(far, of_far), mean(&self.own), self.share[k]);
            for p in 0..3 {
                differences[p][k] = of_one[p];
            }
        }
        differences
    }
}

/// A covariance of few pixels with what goes evenly into all directions.
#[inline(always)]
fn widened(mut spread: Symmetric) -> Symmetric {
    let floor = SHRINKAGE / 3.0 * (spread[0] + spread[3] + spread[5]) + QUANTISATION;
    for k in [0, 3, 5] {
        spread[k] += floor;
    }
    spread
}
