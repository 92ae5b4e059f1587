//! The share of a mixed pixel: what its colour says, and what was likely before that.

use super::EdgePixel;
use super::clusters::Color;
use super::symmetric::{Symmetric, dot, inverse, times};

/// Shares are tried in steps of an eighth.
const STEPS: usize = 9;
const STEP: f32 = 1.0 / (STEPS - 1) as f32;
/// Covariances of few pixels are too narrow: so much of them goes evenly into all directions.
const SHRINKAGE: f32 = 0.01;
/// Variance of what quantisation alone does, in linear light.
const QUANTISATION: f32 = 5e-6;
/// Surfaces have spots that no pixel around is like: so likely a pure pixel is one, times what evens out densities.
const OUTLIER: f32 = 0.02;
/// Light that is off a surface's by more than so many standard deviations is not of it.
const MOST_DEVIATION: f32 = 3.0;
/// Of two pixels in a row at an edge, one borders the other surface only at a corner: it is mixed so much more rarely.
const AT_CORNER: f32 = 0.3;

/// How the colours of two surfaces differ, for how much they vary.
#[derive(Clone, Copy, Debug)]
pub struct Contrast {
    /// Of the near and of the far surface.
    surfaces: [Color; 2],
    discriminant: Discriminant,
    /// The inverse of the covariance that both surfaces' colours vary by.
    inverse: Symmetric,
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
pub(super) const LINE: usize = 4;
pub(super) const FRONT: usize = 9;

impl Discriminant {
    #[inline(always)]
    fn new(near: [f32; 3], inverse: &Symmetric, far: [f32; 3]) -> Self {
        let difference: [f32; 3] = std::array::from_fn(|p| near[p] - far[p]);
        let direction = times(inverse, difference);
        let contrast = dot(direction, difference).max(1e-9);
        let scale = 1.0 / contrast;
        let direction = direction.map(|value| scale * value);
        // Both surfaces' variances are in it, of which a mixed pixel has half each. No finer than the steps.
        Self { direction, offset: dot(direction, far), precision: (2.0 * contrast).min(1000.0) }
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

/// As [`Discriminant::share`], by a [`Contrast::line`].
#[inline(always)]
pub(super) fn share_by([x, y, z, offset]: [f32; LINE], color: [f32; 3]) -> f32 {
    dot([x, y, z], color) - offset
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
        let inverse = inverse(&spread);
        let discriminant = Discriminant::new(near.mean, &inverse, far.mean);
        Self { surfaces, discriminant, inverse }
    }

    /// What tells a colour's share, for [`share_by`]; what lies between two of them does so between their surfaces.
    #[inline(always)]
    pub(super) fn line(&self) -> [f32; LINE] {
        let Discriminant { direction: [x, y, z], offset, .. } = self.discriminant;
        [x, y, z, offset]
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

    /// See [`Discriminant`].
    #[inline(always)]
    pub(super) fn precision(&self) -> f32 {
        self.discriminant.precision
    }

    /// Whether the far surface may have this light here.
    #[inline(always)]
    pub(super) fn is_like_far(&self, light: [f32; 3]) -> bool {
        let Color { mean, covariance } = self.surfaces[1];
        let off = std::array::from_fn(|p| light[p] - mean[p]);
        dot(off, times(&inverse(&widened(covariance)), off)) < MOST_DEVIATION * MOST_DEVIATION
    }

    /// How likely it is that a colour which is a `share` of the near surface before this light is off the line between both by
    /// as much as it is; at most 1.
    #[inline(always)]
    fn off_line(&self, light: [f32; 3], own: [f32; 3], share: f32) -> f32 {
        let near = &self.surfaces[0].mean;
        let share = share.clamp(0.0, 1.0);
        let off = std::array::from_fn(|p| own[p] - light[p] - share * (near[p] - light[p]));
        (-dot(off, times(&self.inverse, off))).exp().max(1e-6)
    }

    /// Colour of the near surface less that of the far one, for a pixel of which the near one has a share: the most likely
    /// ones of those that add up to the pixel's `own` (Chuang et al. 2001, equation 9, with the pixel as exact). None is
    /// darker than black, or brighter than white.
    #[inline(always)]
    pub(super) fn difference(&self, own: [f32; 3], share: f32) -> [f32; 3] {
        let [near, far] = &self.surfaces;
        difference(near, far, own, share)
    }

    /// The same where the light behind is known but for noise.
    #[inline(always)]
    pub(super) fn difference_before(&self, light: [f32; 3], own: [f32; 3], share: f32) -> [f32; 3] {
        let [near, far] = &self.surfaces;
        difference(near, &Color { mean: light, ..*far }, own, share)
    }
}

#[inline(always)]
fn difference(near: &Color, far: &Color, own: [f32; 3], share: f32) -> [f32; 3] {
    let rest = 1.0 - share;
    let spread = std::array::from_fn(|k| share * share * near.covariance[k] + rest * rest * far.covariance[k]);
    let spread = widened(spread);
    let residual = std::array::from_fn(|p| own[p] - share * near.mean[p] - rest * far.mean[p]);
    let step = times(&inverse(&spread), residual);
    let (of_near, of_far) = (times(&near.covariance, step), times(&far.covariance, step));
    let (up, down) = (rest.max(1e-3), share.max(1e-3));
    std::array::from_fn(|p| {
        let difference = near.mean[p] + share * of_near[p] - far.mean[p] - rest * of_far[p];
        let most = ((1.0 - own[p]) / up).min(own[p] / down);
        let least = -(own[p] / up).min((1.0 - own[p]) / down);
        difference.clamp(least.min(0.0), most.max(0.0))
    })
}

/// What the depth map says of a pixel at an edge.
#[derive(Clone, Copy, Debug, Default)]
pub struct Labels {
    /// Whether it is of the near surface.
    pub is_near: bool,
    /// Whether a side of the pixel, and not only a corner, borders the other surface.
    pub borders: bool,
    /// Whether it is part of something so thin that no pixel need be covered by half.
    pub is_thin: bool,
}

/// What is known of a pixel at an edge.
#[derive(Clone, Copy, Debug, Default)]
pub struct Evidence {
    pub edge: EdgePixel,
    pub labels: Labels,
    /// The place of the answer whose contrast it was compared with.
    pub answer: u32,
    /// The light behind it, where that is known.
    pub behind: Option<[f32; 3]>,
    /// Likelihood of the pixel's colour if it is pure, as the map says.
    pure: f32,
    /// The mean over shares of the map's side of one half (of all where it is thin), and of the same times the share.
    half: [f32; 2],
    /// The means over all shares.
    any: [f32; 2],
}

impl Evidence {
    /// Compares a pixel's colour `own` with those of both surfaces, the farther one's being `behind` where that is known and
    /// like that surface.
    #[inline(always)]
    pub(super) fn new(
        edge: &EdgePixel,
        labels: Labels,
        (own, behind): ([f32; 3], Option<[f32; 3]>),
        (place, contrast): (u32, &Contrast),
    ) -> Self {
        let Labels { is_near, is_thin, .. } = labels;
        // What is remembered of a surface that looks otherwise here is not of that surface.
        let behind = behind.filter(|light| contrast.is_like_far(*light));
        let discriminant = behind.map_or(contrast.discriminant, |light| Discriminant::before(contrast.front(), light));
        let precision = discriminant.precision;
        let share = discriminant.share(own);
        let mut likelihoods = gaussian(precision, share.clamp(-0.3, 1.3));
        if let Some(light) = behind {
            // What is no mixture of both has a colour of its own, as lone hair beside a face.
            let unlike = contrast.off_line(light, own, share);
            likelihoods = likelihoods.map(|value| value * unlike);
        }
        let (mut half, mut any) = ([0.0; 2], [0.0; 2]);
        let middle = STEPS / 2;
        let side = if is_near { middle..STEPS } else { 0..middle + 1 };
        let mut means = [[[0.0; STEPS]; 2]; 2];
        for step in 0..STEPS {
            let weighed = [likelihoods[step], likelihoods[step] * STEP * step as f32];
            for k in 0..2 {
                (means[0][k][step], means[1][k][step]) = (weighed[k] / STEPS as f32, weighed[k] / (middle + 1) as f32);
            }
        }
        for k in 0..2 {
            for mean in means[0][k] {
                any[k] += mean;
            }
            for mean in &means[1][k][side.clone()] {
                half[k] += mean;
            }
        }
        if is_thin {
            half = any;
        }
        // No pixel of a surface whose light is known is like none of it.
        let outlier = if is_near || behind.is_none() { OUTLIER / precision.sqrt() } else { 0.0 };
        let pure = likelihoods[if is_near { STEPS - 1 } else { 0 }].max(outlier);
        Self { edge: *edge, labels, answer: place, behind, pure, half, any }
    }
}

/// How likely pixels at edges are mixed at all in this frame, and how often the depth map errs: from a hard mask neither is,
/// and from a camera half of them are. Found by expectation maximisation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Prior {
    mixed: f32,
    wrong: f32,
}

impl Prior {
    /// What makes all that is known of a frame's pixels most likely.
    #[inline(always)]
    pub fn of(evidence: &[Evidence]) -> Self {
        const FLOOR: f32 = 0.002;
        let mut prior = Self { mixed: 0.3, wrong: 0.01 };
        for _ in 0..4 {
            let (mut mixed, mut bordering, mut wrong, mut all) = (0.0, 0.0f32, 0.0, 0.0f32);
            for one in evidence {
                let [pure, half, any] = prior.weights(one);
                let total = pure * one.pure + half * one.half[0] + any * one.any[0];
                if total > f32::MIN_POSITIVE {
                    wrong += any * one.any[0] / total;
                    all += 1.0;
                    if one.labels.borders {
                        mixed += half * one.half[0] / total;
                        bordering += 1.0;
                    }
                }
            }
            prior.mixed = (mixed / bordering.max(1.0)).clamp(FLOOR, 0.9);
            prior.wrong = (wrong / all.max(1.0)).clamp(FLOOR, 0.3);
        }
        prior
    }

    /// How likely a pixel is pure, mixed and mostly what the map says, or anything.
    #[inline(always)]
    fn weights(&self, evidence: &Evidence) -> [f32; 3] {
        let mixed = if evidence.labels.borders { self.mixed } else { AT_CORNER * self.mixed };
        [(1.0 - mixed - self.wrong).max(0.0), mixed, self.wrong]
    }

    /// The expected share of the near surface, 0 to 1.
    #[inline(always)]
    pub fn share(&self, evidence: &Evidence) -> f32 {
        let is_near = f32::from(u8::from(evidence.labels.is_near));
        let [pure, half, any] = self.weights(evidence);
        let total = pure * evidence.pure + half * evidence.half[0] + any * evidence.any[0];
        if total > f32::MIN_POSITIVE {
            (pure * evidence.pure * is_near + half * evidence.half[1] + any * evidence.any[1]) / total
        } else {
            is_near
        }
    }
}

/// exp(-precision (share - mean)^2 / 2) at all shares that are tried. From one to the next it changes by a factor that itself
/// changes by a constant factor: four exponentials are enough.
#[inline(always)]
fn gaussian(precision: f32, mean: f32) -> [f32; STEPS] {
    // As good as nothing. Smaller numbers soon have less precision, and processors take a hundred times as long for them.
    const LEAST: f32 = 1e-18;
    let peak = (mean / STEP + 0.5).clamp(0.0, (STEPS - 1) as f32).floor();
    let off = peak * STEP - mean;
    let curve = (-precision * STEP * STEP).exp();
    let slope = |direction: f32| (-precision * STEP * (direction * off + 0.5 * STEP)).exp();
    let (mut values, peak) = ([0.0; STEPS], peak as usize);
    values[peak] = (-0.5 * precision * off * off).exp().max(LEAST);
    let (mut up, mut down) = (slope(1.0), slope(-1.0));
    for step in peak + 1..STEPS {
        values[step] = (values[step - 1] * up).max(LEAST);
        up = (up * curve).max(LEAST);
    }
    for step in (0..peak).rev() {
        values[step] = (values[step + 1] * down).max(LEAST);
        down = (down * curve).max(LEAST);
    }
    values
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
