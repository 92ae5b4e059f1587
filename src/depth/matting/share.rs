//! The share of a mixed pixel: what its colour says, and what was likely before that.

#![allow(clippy::needless_range_loop)] // Steps and pixels index several arrays at once.

use super::larger;

/// Pixels that are weighed at once. So many for every processor, as the sums over all pixels depend on it.
pub const LANES: usize = 16;
/// Numbers of that many pixels.
pub type Lanes = [f32; LANES];

/// Shares are tried in steps of an eighth.
pub const STEPS: usize = 9;
const STEP: f32 = 1.0 / (STEPS - 1) as f32;
/// Those of the map's side of one half.
const MIDDLE: usize = STEPS / 2;
const SIDE: usize = STEPS - MIDDLE;
/// Surfaces have spots that no pixel around is like: so likely a pure pixel is one, times what evens out densities.
pub const OUTLIER: f32 = 0.02;

/// How many of a pixel's four sides, and of its four corners, are of its own surface, where the outline is about straight.
pub const OUTLINES: [(u32, u32); 5] = [(2, 2), (2, 3), (3, 2), (3, 3), (4, 3)];
/// For each of them: how likely the pixel's own surface has half of it, five eighths, and so on to all of it, over straight
/// outlines in all directions that pass anywhere; but for a part, which is evenly any of these, as of all other outlines (the more,
/// the likelier it is that only something thin passes there). The last row is of pixels beyond the edges of the map, which are
/// traced.
pub const SHARES: [[f32; SIDE]; OUTLINES.len() + 2] = [
    [0.2, 0.2, 0.2, 0.2, 0.2],
    [0.227, 0.358, 0.254, 0.133, 0.029],
    [0.058, 0.095, 0.177, 0.365, 0.305],
    [0.029, 0.083, 0.137, 0.218, 0.533],
    [0.140, 0.140, 0.140, 0.146, 0.434],
    [0.100, 0.100, 0.100, 0.100, 0.600],
    [0.060, 0.060, 0.060, 0.060, 0.760],
];
/// Likelihoods that are as good as nothing, of a share, and of a colour that is off the line between both surfaces.
pub const LEAST: f32 = 1e-18;
pub const LEAST_OFF_LINE: f32 = 1e-6;

/// What the depth map says of a pixel at an edge.
#[derive(Clone, Copy, Debug, Default)]
pub struct Labels {
    /// Whether it is of the near surface.
    pub is_near: bool,
    /// Whether a side of the pixel, and not only a corner, borders the other surface.
    pub borders: bool,
    /// Which row of [`SHARES`] its sides and corners have.
    pub outline: u8,
    /// Whether it is part of something so thin that no pixel need be covered by half.
    pub is_thin: bool,
}

impl Labels {
    /// Those of a pixel beyond the edges of the map.
    pub const BEYOND: Self = Self { is_near: false, borders: false, outline: OUTLINES.len() as u8 + 1, is_thin: false };

    /// What a pixel's sides and corners say, of which so many are of its own surface; `borders` where a side is of the other one.
    #[inline(always)]
    pub fn new(is_near: bool, borders: bool, sides: u32, corners: u32) -> Self {
        let mut outline = 0;
        for (k, at) in OUTLINES.iter().enumerate() {
            outline = if *at == (sides, corners) { k as u8 + 1 } else { outline };
        }
        // Two neighbours in a row, at most.
        Self { is_near, borders, outline, is_thin: is_near && sides + corners <= 2 }
    }
}

/// What the colours of some pixels at edges say; of the places that are left over, nothing.
#[derive(Clone, Copy, Debug)]
pub struct Colors {
    /// What share of the near surface it is, from below 0 to above 1, and the reciprocal variance of that.
    share: Lanes,
    precision: Lanes,
    /// How far it is off the line between both surfaces, as a squared distance in standard deviations.
    off_line: Lanes,
    /// Labels, 1 or 0; whether there is a pixel at all.
    is_near: Lanes,
    borders: Lanes,
    is_thin: Lanes,
    /// How likely each share of the pixel's own surface was, from half of it to all.
    shares: [Lanes; SIDE],
    is_there: Lanes,
    /// How likely it is that a pure pixel is like none, times the deviation of its share.
    outlier: Lanes,
}

impl Colors {
    pub const NONE: Self = Self {
        share: [0.0; LANES],
        precision: [1.0; LANES],
        off_line: [0.0; LANES],
        is_near: [0.0; LANES],
        borders: [0.0; LANES],
        is_thin: [0.0; LANES],
        shares: [[0.0; LANES]; SIDE],
        is_there: [0.0; LANES],
        outlier: [0.0; LANES],
    };

    /// Adds a pixel; `off_line` where the light behind it is known.
    #[inline(always)]
    pub fn set(&mut self, k: usize, labels: Labels, (share, precision): (f32, f32), off_line: Option<f32>) {
        let Labels { is_near, borders, outline, is_thin } = labels;
        let number = |is: bool| f32::from(u8::from(is));
        (self.share[k], self.precision[k], self.off_line[k]) = (share, precision, off_line.unwrap_or(0.0));
        (self.is_near[k], self.borders[k], self.is_thin[k]) = (number(is_near), number(borders), number(is_thin));
        for (shares, share) in self.shares.iter_mut().zip(SHARES[usize::from(outline)]) {
            shares[k] = share;
        }
        // No pixel of a surface whose light is known is like none of it.
        (self.is_there[k], self.outlier[k]) = (1.0, OUTLIER * number(is_near || off_line.is_none()));
    }
}

/// What is known of some pixels at edges.
#[derive(Clone, Copy, Debug, Default)]
pub struct Evidence {
    is_near: Lanes,
    borders: Lanes,
    /// Likelihood of the pixel's colour if it is pure, as the map says.
    pure: Lanes,
    /// The expectation over shares of the map's side of one half (over all where it is thin), and that of the same times the share.
    half: [Lanes; 2],
    /// The means over all shares.
    any: [Lanes; 2],
}

impl Evidence {
    /// How likely colours are for each share.
    #[inline(always)]
    pub fn of(colors: &Colors) -> Self {
        let mut evidence = Self { is_near: colors.is_near, borders: colors.borders, ..Self::default() };
        for k in 0..LANES {
            let (share, precision) = (colors.share[k], colors.precision[k]);
            let share = if share > -0.3 { share } else { -0.3 };
            let share = if share < 1.3 { share } else { 1.3 };
            // What is no mixture of both has a colour of its own, as lone hair beside a face.
            let fits = colors.is_there[k] * larger(exp(-colors.off_line[k]), LEAST_OFF_LINE);
            let mut likelihoods = [0.0; STEPS];
            let mut any = [0.0; 2];
            for step in 0..STEPS {
                let tried = step as f32 * STEP;
                let off = tried - share;
                likelihoods[step] = fits * larger(exp(-0.5 * precision * off * off), LEAST);
                any[0] += likelihoods[step];
                any[1] += likelihoods[step] * tried;
            }
            let (is_near, is_thin) = (colors.is_near[k] > 0.0, colors.is_thin[k] > 0.0);
            let mut side = [0.0; 2];
            for own in 0..SIDE {
                let step = if is_near { MIDDLE + own } else { MIDDLE - own };
                let likely = colors.shares[own][k] * likelihoods[step];
                side[0] += likely;
                side[1] += likely * (step as f32 * STEP);
            }
            for n in 0..2 {
                let any = any[n] * (1.0 / STEPS as f32);
                evidence.any[n][k] = any;
                evidence.half[n][k] = if is_thin { any } else { side[n] };
            }
            let pure = if is_near { likelihoods[STEPS - 1] } else { likelihoods[0] };
            evidence.pure[k] = larger(pure, colors.outlier[k] / precision.sqrt());
        }
        evidence
    }
}

/// How likely pixels at edges are mixed at all in this frame, and how often the depth map errs: from a hard mask neither is,
/// and from a camera half of them are. Found by expectation maximisation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Prior {
    pub mixed: f32,
    pub wrong: f32,
}

/// The first guess, what is least likely of both, what is most, and rounds until it is found.
pub const PRIOR: Prior = Prior { mixed: 0.3, wrong: 0.01 };
pub const PRIOR_FLOOR: f32 = 0.002;
pub const PRIOR_MOST: Prior = Prior { mixed: 0.9, wrong: 0.3 };
pub const PRIOR_ROUNDS: usize = 4;

impl Prior {
    /// What makes all that is known of a frame's pixels most likely.
    #[inline(always)]
    pub fn of(evidence: &[Evidence]) -> Self {
        let mut prior = PRIOR;
        for _ in 0..PRIOR_ROUNDS {
            let [pure, half, any] = prior.weights();
            let [mut mixed, mut bordering, mut wrong, mut all] = [[0.0f32; LANES]; 4];
            for one in evidence {
                for k in 0..LANES {
                    let (half, any) = (half * one.half[0][k], any * one.any[0][k]);
                    let total = pure * one.pure[k] + half + any;
                    let is_told = f32::from(u8::from(total > f32::MIN_POSITIVE));
                    let share = is_told / larger(total, f32::MIN_POSITIVE);
                    wrong[k] += any * share;
                    all[k] += is_told;
                    mixed[k] += one.borders[k] * (half * share);
                    bordering[k] += one.borders[k] * is_told;
                }
            }
            let [mixed, bordering, wrong, all] = [mixed, bordering, wrong, all].map(|sums| sums.iter().sum::<f32>());
            prior.mixed = (mixed / bordering.max(1.0)).clamp(PRIOR_FLOOR, PRIOR_MOST.mixed);
            prior.wrong = (wrong / all.max(1.0)).clamp(PRIOR_FLOOR, PRIOR_MOST.wrong);
        }
        prior
    }

    /// How likely a pixel is pure, part of a soft outline where the map says, or anything.
    #[inline(always)]
    fn weights(&self) -> [f32; 3] {
        [larger(1.0 - self.mixed - self.wrong, 0.0), self.mixed, self.wrong]
    }

    /// The expected shares of the near surface, 0 to 1.
    #[inline(always)]
    pub fn shares(&self, one: &Evidence) -> Lanes {
        let [pure, half, any] = self.weights();
        let mut shares = [0.0; LANES];
        for k in 0..LANES {
            let pure = pure * one.pure[k];
            let total = pure + half * one.half[0][k] + any * one.any[0][k];
            let near = pure * one.is_near[k] + half * one.half[1][k] + any * one.any[1][k];
            shares[k] = if total > f32::MIN_POSITIVE { near / total } else { one.is_near[k] };
        }
        shares
    }
}

/// e to a power that is not above 0, to within some 2e-7 of it, and as good as nothing below e to the -80: without branches and
/// calls, so that loops become vector code, and the same on every processor.
#[inline(always)]
fn exp(power: f32) -> f32 {
    // Added to a small number, it leaves that rounded to a whole one, in its lowest bits.
    const ROUND: f32 = 12_582_912.0;
    /// ln 2, in two parts, of which the first times a small whole number is exact.
    const LN_2: [f32; 2] = [355.0 / 512.0, -2.121_944_4e-4];
    const BIAS: u32 = 127;
    const MANTISSA_BITS: u32 = f32::MANTISSA_DIGITS - 1;
    let power = larger(power, -80.0);
    let rounded = power * std::f32::consts::LOG2_E + ROUND;
    let whole = rounded - ROUND;
    let rest = power - whole * LN_2[0] - whole * LN_2[1];
    let mut value = 1.0 / 720.0;
    for factor in [1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0] {
        value = value * rest + factor;
    }
    value * f32::from_bits((rounded.to_bits() << MANTISSA_BITS).wrapping_add(BIAS << MANTISSA_BITS))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether a place is on the near side of a straight outline.
    fn is_inside(direction: [f32; 2], offset: f32, x: f32, y: f32) -> bool {
        direction[0] * x + direction[1] * y < offset
    }

    #[test]
    fn shares_are_those_of_straight_outlines_that_pass_anywhere() {
        const SAMPLES: usize = 12;
        let mut found = [[0.0f32; SIDE]; OUTLINES.len()];
        for turn in 0..360 {
            let (sin, cos) = (turn as f32 + 0.5).to_radians().sin_cos();
            for offset in (-140..140).map(|k| 0.01 * k as f32 + 0.005) {
                let is_near = |x: i32, y: i32| is_inside([cos, sin], offset, x as f32, y as f32);
                let alike = |places: [(i32, i32); 4]| {
                    places.iter().filter(|(x, y)| is_near(*x, *y) == is_near(0, 0)).count() as u32
                };
                let counts = (alike([(1, 0), (-1, 0), (0, 1), (0, -1)]), alike([(1, 1), (-1, 1), (1, -1), (-1, -1)]));
                let Some(row) = OUTLINES.iter().position(|at| *at == counts) else { continue };
                let at = |k: usize| (k as f32 + 0.5) / SAMPLES as f32 - 0.5;
                let of_own =
                    |k: &usize| is_inside([cos, sin], offset, at(k % SAMPLES), at(k / SAMPLES)) == is_near(0, 0);
                let share = (0..SAMPLES * SAMPLES).filter(of_own).count() as f32 / (SAMPLES * SAMPLES) as f32;
                let step = ((share - 0.5).max(0.0) / STEP).min((SIDE - 1) as f32);
                let below = (step as usize).min(SIDE - 2);
                found[row][below] += 1.0 - (step - below as f32);
                found[row][below + 1] += step - below as f32;
            }
        }
        for (found, shares) in found.iter().zip(&SHARES[1..]) {
            let total: f32 = found.iter().sum();
            // What is evenly any share is as much as the least likely one has, and no more than three quarters.
            let even = SIDE as f32 * shares.iter().copied().fold(1.0, f32::min);
            assert!(even < 0.75, "{shares:?}");
            let least = found.iter().copied().fold(total, f32::min) / total;
            let even = (even - SIDE as f32 * least).max(0.0);
            for (found, share) in found.iter().zip(shares) {
                let expected = (1.0 - even) * found / total + even / SIDE as f32;
                assert!((share - expected).abs() < 0.03, "{share} is not {expected}: {shares:?}, {found:?}");
            }
        }
        SHARES.iter().for_each(|shares| assert!((shares.iter().sum::<f32>() - 1.0).abs() < 2e-3, "{shares:?}"));
    }

    #[test]
    fn powers_of_e_are_as_good_as_those_of_the_library() {
        assert_eq!(exp(0.0), 1.0);
        for k in 0..8000 {
            let power = -0.01 * k as f32;
            let exact = f64::from(power).exp();
            assert!((f64::from(exp(power)) / exact - 1.0).abs() < 4e-7, "{power}");
        }
        assert!((0.0..1e-30).contains(&exp(-1e30)));
    }
}
