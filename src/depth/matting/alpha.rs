//! Alpha of mixed pixels: the posterior mean, from the likelihood of the colour and a prior from the depth map
//! (Bayesian matting, Chuang et al. 2001).
//! twin: shaders/matte/compare.wgsl, matte/prior.wgsl, matte/weights.wgsl

#![allow(clippy::needless_range_loop)] // Steps and pixels index several arrays at once.

use super::contrast::Color;
use super::fast_max;
use super::mixture::ColorBatch;

/// Pixels evaluated at once. The same number on every processor, since the order of the sums over all pixels depends on
/// it.
pub const LANES: usize = 16;
/// One number per lane.
pub type Lanes = [f32; LANES];

/// Number of alphas that are sampled, in steps of an eighth.
pub const STEPS: usize = 9;
const STEP: f32 = 1.0 / (STEPS - 1) as f32;
/// Index of one half, and number of samples on the map's side of it.
const MIDDLE: usize = STEPS / 2;
const SIDE: usize = STEPS - MIDDLE;
/// Density of a pure pixel that is an outlier, a spot of a colour that no pixel around has: its probability, evenly over
/// all colours.
pub const OUTLIER: f32 = 0.02;

/// Numbers of a pixel's four sides, and four corners, on its own surface, for outlines that are about straight.
pub const OUTLINES: [(u32, u32); 5] = [(2, 2), (2, 3), (3, 2), (3, 3), (4, 3)];
/// Prior probability that the pixel's own surface covers 1/2, 5/8, ... 1 of it, for each of [`OUTLINES`]: for straight
/// outlines in all directions and positions, mixed with a uniform distribution (the larger, the likelier it is that
/// only something thin passes there). The first row is for all other outlines, the last one for traced pixels beyond
/// the map's edges.
pub const ALPHA_PRIORS: [[f32; SIDE]; OUTLINES.len() + 2] = [
    [0.2, 0.2, 0.2, 0.2, 0.2],
    [0.227, 0.358, 0.254, 0.133, 0.029],
    [0.058, 0.095, 0.177, 0.365, 0.305],
    [0.029, 0.083, 0.137, 0.218, 0.533],
    [0.140, 0.140, 0.140, 0.146, 0.434],
    [0.100, 0.100, 0.100, 0.100, 0.600],
    [0.060, 0.060, 0.060, 0.060, 0.760],
];
/// Probability that a pixel is pure though outlines are soft, relative to straight outlines, for the rows of
/// [`ALPHA_PRIORS`]: less for other outlines, such as hair's, and where the outline passes through the middle.
pub const PURE_PRIORS: [f32; OUTLINES.len() + 2] = [0.3, 0.5, 1.0, 1.0, 1.0, 1.0, 1.0];
/// Lower bound of the likelihood of an alpha.
pub const MIN_LIKELIHOOD: f32 = 1e-12;

/// Labels of an edge pixel, from the depth map.
#[derive(Clone, Copy, Debug, Default)]
pub struct Labels {
    /// Whether it belongs to the near surface.
    pub is_near: bool,
    /// Whether the other surface is on a side of the pixel, not only at a corner.
    pub borders: bool,
    /// Row of [`ALPHA_PRIORS`], by the sides and corners.
    pub outline: u8,
    /// Whether it is part of something so thin that it may cover less than half of any pixel.
    pub is_thin: bool,
}

impl Labels {
    /// Labels of a traced pixel, beyond the edges of the map.
    pub const BEYOND: Self = Self { is_near: false, borders: false, outline: OUTLINES.len() as u8 + 1, is_thin: false };

    /// Creates labels from the numbers of `sides` and `corners` on the pixel's own surface; `borders` if a side is on
    /// the other surface.
    #[inline(always)]
    pub fn new(is_near: bool, borders: bool, sides: u32, corners: u32) -> Self {
        let mut outline = 0;
        for (k, at) in OUTLINES.iter().enumerate() {
            outline = if *at == (sides, corners) { k as u8 + 1 } else { outline };
        }
        // At most two neighbours, as on a line.
        Self { is_near, borders, outline, is_thin: is_near && sides + corners <= 2 }
    }
}

/// Several pixels with their labels and the colours of both surfaces around, as a structure of arrays; unused lanes have
/// `is_there` 0.
#[derive(Clone, Copy, Debug)]
pub struct Colors {
    batch: ColorBatch,
    /// Labels, 1 or 0; the last one is 1 if the lane is used.
    is_near: Lanes,
    borders: Lanes,
    is_thin: Lanes,
    /// Prior probabilities of the own surface's coverage, from one half to 1.
    priors: [Lanes; SIDE],
    is_there: Lanes,
    /// See [`PURE_PRIORS`].
    pure_prior: Lanes,
    /// Density of outliers of the own surface.
    outlier: Lanes,
}

impl Colors {
    pub const NONE: Self = Self {
        batch: ColorBatch::NONE,
        is_near: [0.0; LANES],
        borders: [0.0; LANES],
        is_thin: [0.0; LANES],
        priors: [[0.0; LANES]; SIDE],
        is_there: [0.0; LANES],
        pure_prior: [0.0; LANES],
        outlier: [0.0; LANES],
    };

    /// Sets lane `k` to a pixel's `own` light, its labels and both surfaces around; `has_background` if the far one is
    /// that behind this very pixel.
    #[inline(always)]
    pub fn set_lane(&mut self, k: usize, labels: Labels, own: [f32; 3], surfaces: [Color; 2], has_background: bool) {
        let Labels { is_near, borders, outline, is_thin } = labels;
        let number = |is: bool| f32::from(u8::from(is));
        self.batch.set_lane(k, surfaces, own, 0.0);
        (self.is_near[k], self.borders[k], self.is_thin[k]) = (number(is_near), number(borders), number(is_thin));
        for (priors, prior) in self.priors.iter_mut().zip(ALPHA_PRIORS[usize::from(outline)]) {
            priors[k] = prior;
        }
        // With a known background, a far pixel is no outlier.
        self.pure_prior[k] = PURE_PRIORS[usize::from(outline)];
        (self.is_there[k], self.outlier[k]) = (1.0, OUTLIER * number(is_near || !has_background));
    }
}

/// Likelihoods of several edge pixels.
#[derive(Clone, Copy, Debug, Default)]
pub struct Evidence {
    is_near: Lanes,
    borders: Lanes,
    /// Likelihood of the colour of a pure pixel of the labelled surface.
    pure: Lanes,
    /// Expected likelihood over the alphas on the map's side of one half (over all if thin), and of likelihood times
    /// alpha.
    sided: [Lanes; 2],
    /// Means of both over all alphas.
    any_alpha: [Lanes; 2],
}

impl Evidence {
    /// Computes the likelihoods over the sampled alphas.
    #[inline(always)]
    pub fn new(colors: &Colors) -> Self {
        let mut evidence = Self { is_near: colors.is_near, borders: colors.borders, ..Self::default() };
        // Steps outside, lanes inside, so that every inner loop becomes vector code.
        let regular = colors.batch.regularized();
        let mut likelihoods = [[0.0; LANES]; STEPS];
        let mut all = [[0.0; LANES]; 2];
        for (step, likelihoods) in likelihoods.iter_mut().enumerate() {
            let tried = step as f32 * STEP;
            let densities = regular.densities(tried);
            for k in 0..LANES {
                let likely = colors.is_there[k] * fast_max(densities[k], MIN_LIKELIHOOD);
                likelihoods[k] = likely;
                all[0][k] += likely;
                all[1][k] += likely * tried;
            }
        }
        let mut sided = [[0.0; LANES]; 2];
        for own in 0..SIDE {
            let [near, far] = [MIDDLE + own, MIDDLE - own];
            for k in 0..LANES {
                let is_near = colors.is_near[k] > 0.0;
                let likelihood = if is_near { likelihoods[near][k] } else { likelihoods[far][k] };
                let tried = if is_near { near as f32 * STEP } else { far as f32 * STEP };
                let likely = colors.priors[own][k] * likelihood;
                sided[0][k] += likely;
                sided[1][k] += likely * tried;
            }
        }
        for n in 0..2 {
            for k in 0..LANES {
                let mean = all[n][k] * (1.0 / STEPS as f32);
                evidence.any_alpha[n][k] = mean;
                evidence.sided[n][k] = if colors.is_thin[k] > 0.0 { mean } else { sided[n][k] };
            }
        }
        for k in 0..LANES {
            let pure = if colors.is_near[k] > 0.0 { likelihoods[STEPS - 1][k] } else { likelihoods[0][k] };
            evidence.pure[k] = colors.pure_prior[k] * fast_max(pure, colors.outlier[k]);
        }
        evidence
    }
}

/// Probabilities, in this frame, that an edge pixel is mixed at all, and that the depth map is wrong. For a hard mask
/// both are 0; for a camera, about half of the edge pixels are mixed. Estimated by expectation maximisation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Prior {
    pub mixed: f32,
    pub wrong: f32,
}

/// Initial value, lower bound of both, upper bounds, and number of iterations.
pub const PRIOR: Prior = Prior { mixed: 0.6, wrong: 0.01 };
pub const PRIOR_MIN: f32 = 0.002;
pub const PRIOR_MAX: Prior = Prior { mixed: 0.9, wrong: 0.3 };
pub const PRIOR_ROUNDS: usize = 4;

impl Prior {
    /// Estimates the prior of a frame by expectation maximisation over the evidence of its pixels.
    #[inline(always)]
    pub fn estimate(evidence: &[Evidence]) -> Self {
        let mut prior = PRIOR;
        for _ in 0..PRIOR_ROUNDS {
            let [pure_weight, sided_weight, any_weight] = prior.mixture_weights();
            let [mut mixed, mut bordering, mut wrong, mut all] = [[0.0f32; LANES]; 4];
            for one in evidence {
                for k in 0..LANES {
                    let (sided, any) = (sided_weight * one.sided[0][k], any_weight * one.any_alpha[0][k]);
                    let total = pure_weight * one.pure[k] + sided + any;
                    let is_valid = f32::from(u8::from(total > f32::MIN_POSITIVE));
                    let scale = is_valid / fast_max(total, f32::MIN_POSITIVE);
                    wrong[k] += any * scale;
                    all[k] += is_valid;
                    mixed[k] += one.borders[k] * (sided * scale);
                    bordering[k] += one.borders[k] * is_valid;
                }
            }
            let [mixed, bordering, wrong, all] = [mixed, bordering, wrong, all].map(|sums| sums.iter().sum::<f32>());
            prior.mixed = (mixed / bordering.max(1.0)).clamp(PRIOR_MIN, PRIOR_MAX.mixed);
            prior.wrong = (wrong / all.max(1.0)).clamp(PRIOR_MIN, PRIOR_MAX.wrong);
        }
        prior
    }

    /// Returns the weights of a pure pixel, of a soft outline where the map has it, and of any alpha.
    #[inline(always)]
    fn mixture_weights(&self) -> [f32; 3] {
        [fast_max(1.0 - self.mixed - self.wrong, 0.0), self.mixed, self.wrong]
    }

    /// Returns the posterior means of alpha, 0 to 1.
    #[inline(always)]
    pub fn posterior_alphas(&self, one: &Evidence) -> Lanes {
        let [pure_weight, sided_weight, any_weight] = self.mixture_weights();
        let mut alphas = [0.0; LANES];
        for k in 0..LANES {
            let pure = pure_weight * one.pure[k];
            let total = pure + sided_weight * one.sided[0][k] + any_weight * one.any_alpha[0][k];
            let near = pure * one.is_near[k] + sided_weight * one.sided[1][k] + any_weight * one.any_alpha[1][k];
            alphas[k] = if total > f32::MIN_POSITIVE { near / total } else { one.is_near[k] };
        }
        alphas
    }
}

#[cfg(test)]
mod tests;
