//! Mixtures of two surfaces' colours: the likelihood of a pixel's light for each alpha, and the two colours that make up
//! a mixed pixel.
//! twin: shaders/matte/compare.wgsl, matte/mix.wgsl

#![allow(clippy::needless_range_loop)] // Planes and pixels index several arrays at once.

use super::alpha::{LANES, Lanes};
use super::contrast::{Color, regularize};
use super::symmetric::{Symmetric, invert, multiply};
use super::{fast_max, fast_min};

/// Isotropic part of the covariances of likelihoods. Less than for a line between two means: also how far a colour is
/// off that line says that it is no mixture.
pub(super) const ISOTROPY: f32 = 0.002;
/// Variance of the noise of a pixel, in linear light.
pub(super) const NOISE: f32 = 2e-5;
/// Minimum variance of alpha: a surface's mean colour is never that at the pixel.
pub(super) const ALPHA_VARIANCE: f32 = 1e-3;
/// Degrees of freedom of the distribution of colours: with 5, its exponent is 4 in three dimensions.
const FREEDOM: f32 = 5.0;
/// Lower bound of the variance of one channel given the others, beyond rounding.
pub(super) const MIN_VARIANCE: f32 = 1e-6;

/// Several pixels and their surfaces, as a structure of arrays.
#[derive(Clone, Copy, Debug)]
pub(super) struct ColorBatch {
    means: [[Lanes; 3]; 2],
    covariances: [[Lanes; 6]; 2],
    own: [Lanes; 3],
    alpha: Lanes,
}

impl ColorBatch {
    pub const NONE: Self = Self {
        means: [[[0.0; LANES]; 3]; 2],
        covariances: [[[0.0; LANES]; 6]; 2],
        own: [[0.0; LANES]; 3],
        alpha: [0.0; LANES],
    };

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

    /// Prepares [`Regularized::densities`].
    #[inline(always)]
    pub fn regularized(&self) -> Regularized {
        let zeros = [0.0; LANES];
        let mut regular = Regularized {
            covariances: self.covariances,
            floor: [zeros; 6],
            off_far: [zeros; 3],
            difference: [zeros; 3],
        };
        for k in 0..LANES {
            for of_one in &mut regular.covariances {
                let part = ISOTROPY / 3.0 * (of_one[0][k] + of_one[3][k] + of_one[5][k]);
                for p in [0, 3, 5] {
                    of_one[p][k] += part;
                }
            }
            let ([near, far], mut difference) = (&self.means, [0.0; 3]);
            for p in 0..3 {
                difference[p] = near[p][k] - far[p][k];
                (regular.off_far[p][k], regular.difference[p][k]) = (self.own[p][k] - far[p][k], difference[p]);
            }
            let [r, g, b] = difference;
            let squares = [r * r, r * g, r * b, g * g, g * b, b * b];
            for p in 0..6 {
                regular.floor[p][k] = ALPHA_VARIANCE * squares[p] + if matches!(p, 0 | 3 | 5) { NOISE } else { 0.0 };
            }
        }
        regular
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

/// A [`ColorBatch`] for likelihoods: its covariances with an isotropic part, those of any alpha, the pixels' light less
/// the far surfaces' mean, and the difference of both means.
#[derive(Clone, Copy, Debug)]
pub(super) struct Regularized {
    covariances: [[Lanes; 6]; 2],
    floor: [Lanes; 6],
    off_far: [Lanes; 3],
    difference: [Lanes; 3],
}

impl Regularized {
    /// Returns the densities of all lanes' light at `alpha`, without their constant factor: of the sum of both surfaces'
    /// colours in these proportions, as a Student t distribution in three dimensions. Its long tails suit sharpened
    /// pictures, and chroma of half resolution, whose mixed pixels are off the line between both colours.
    #[inline(always)]
    pub fn densities(&self, alpha: f32) -> Lanes {
        let (of_near, of_far) = (alpha * alpha, (1.0 - alpha) * (1.0 - alpha));
        let [near, far] = &self.covariances;
        let mut densities = [0.0; LANES];
        for k in 0..LANES {
            let mut spread: Symmetric = [0.0; 6];
            for p in 0..6 {
                spread[p] = of_near * near[p][k] + of_far * far[p][k] + self.floor[p][k];
            }
            let mut off = [0.0; 3];
            for p in 0..3 {
                off[p] = self.off_far[p][k] - alpha * self.difference[p][k];
            }
            // By the decomposition into a triangular and a diagonal matrix (Cholesky).
            let [xx, xy, xz, yy, yz, zz] = spread;
            let by_x = 1.0 / xx;
            let (y_of_x, z_of_x) = (xy * by_x, xz * by_x);
            let y = fast_max(yy - y_of_x * xy, MIN_VARIANCE);
            let by_y = 1.0 / y;
            let yz_rest = yz - z_of_x * xy;
            let z_of_y = yz_rest * by_y;
            let z = fast_max(zz - z_of_x * xz - z_of_y * yz_rest, MIN_VARIANCE);
            let (off_x, off_y) = (off[0], off[1] - y_of_x * off[0]);
            let off_z = off[2] - z_of_x * off_x - z_of_y * off_y;
            let distance = off_x * off_x * by_x + off_y * off_y * by_y + off_z * off_z * (1.0 / z);
            let tail = 1.0 + distance / FREEDOM;
            densities[k] = 1.0 / (tail * tail * tail * tail * (xx * y * z).sqrt());
        }
        densities
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
