//! Posterior mean of alpha, from a mask and a colour between those of two surfaces, as a lookup table.

#![allow(clippy::needless_range_loop)] // Lanes index several arrays at once.

use crate::depth::matting::{fast_max, fast_min};

/// Pixels looked up at once, and one number for each.
pub const LANES: usize = 8;
pub type Lanes = [f32; LANES];

/// Number of alphas that are sampled, in steps of an eighth.
const STEPS: usize = 9;
/// Prior probability of a mixed pixel where the mask is undecided, uniform over alpha. It decreases with the mask's
/// certainty, so that the posterior mean is close to the mask if colours say nothing.
const MIXED: f32 = 0.25;
/// Upper bound of the mask's certainty.
const MAX_SURE: f32 = 0.985;
/// Probability that a pure pixel is an outlier, a spot of a colour that no pixel around has, times a factor that makes
/// it comparable with the densities.
const OUTLIER: f32 = 0.05;

/// Size of the table: mask values, colour positions from [`MIN_PLACE`] on in steps of [`STEP`], and precisions, each
/// twice the previous one.
const MASKS: usize = 33;
const PLACES: usize = 65;
const MIN_PLACE: f32 = -0.3;
const STEP: f32 = (1.3 - MIN_PLACE) / (PLACES - 1) as f32;
const PRECISIONS: usize = 11;

/// Posterior mean of alpha, by precision, mask and position.
#[derive(Debug)]
pub struct Posterior(Vec<f32>);

impl Posterior {
    pub fn new() -> Self {
        let mut table = Vec::with_capacity(PRECISIONS * MASKS * PLACES);
        for precision in (0..PRECISIONS).map(|k| (1u32 << k) as f32) {
            for mask in (0..MASKS).map(|k| k as f32 / (MASKS - 1) as f32) {
                table.extend((0..PLACES).map(|k| mean_alpha(mask, MIN_PLACE + STEP * k as f32, precision)));
            }
        }
        Self(table)
    }

    /// Looks up alpha for mask values, 0 to 1, and colours at `places` (0: far colour, 1: near colour), whose
    /// reciprocal variances are `precisions`.
    #[inline(always)]
    pub fn alphas(&self, masks: &Lanes, places: &Lanes, precisions: &Lanes) -> Lanes {
        let (mut first, mut along) = ([0; LANES], [0.0; LANES]);
        for k in 0..LANES {
            // The exponent of a float is its base-2 logarithm, rounded down.
            let exponent =
                (std::f32::consts::SQRT_2 * fast_max(precisions[k], 1.0)).to_bits() >> (f32::MANTISSA_DIGITS - 1);
            let slice = (exponent - 127).min(PRECISIONS as u32 - 1);
            let row = round(masks[k] * (MASKS - 1) as f32).min(MASKS as u32 - 1);
            let place = (places[k] - MIN_PLACE) * (1.0 / STEP);
            let place = fast_min(fast_max(place, 0.0), (PLACES - 1) as f32);
            let before = round(place - 0.5).min(PLACES as u32 - 2);
            first[k] = (slice * MASKS as u32 + row) * PLACES as u32 + before;
            along[k] = place - before as i32 as f32;
        }
        let mut alphas = [0.0; LANES];
        for k in 0..LANES {
            let beside = &self.0[first[k] as usize..][..2];
            alphas[k] = beside[0] + (beside[1] - beside[0]) * along[k];
        }
        alphas
    }
}

/// Returns the integer next to a number: without the checks of a conversion, which would not be vectorised. Any number
/// that is negative or too large gives a large one.
#[inline(always)]
fn round(number: f32) -> u32 {
    /// Sums with it have no fraction bits.
    const LARGE: f32 = 1.5 * (1 << (f32::MANTISSA_DIGITS - 1)) as f32;
    (number + LARGE).to_bits().wrapping_sub(LARGE.to_bits())
}

impl Default for Posterior {
    fn default() -> Self {
        Self::new()
    }
}

fn mean_alpha(mask: f32, place: f32, precision: f32) -> f32 {
    let mask = mask.clamp(1.0 - MAX_SURE, MAX_SURE);
    let mixed = MIXED * 4.0 * mask * (1.0 - mask);
    let (mut sum, mut all) = (0.0, 0.0);
    for step in 0..STEPS {
        let alpha = step as f32 / (STEPS - 1) as f32;
        let likelihood = (-0.5 * precision * (place - alpha) * (place - alpha)).exp();
        let (prior, likelihood) = match step {
            0 => ((1.0 - mixed) * (1.0 - mask), likelihood.max(OUTLIER / precision.sqrt())),
            _ if step == STEPS - 1 => ((1.0 - mixed) * mask, likelihood.max(OUTLIER / precision.sqrt())),
            _ => (0.0, likelihood),
        };
        let weight = (prior + mixed / STEPS as f32) * likelihood;
        (sum, all) = (sum + weight * alpha, all + weight);
    }
    sum / all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_decide_where_they_can_and_the_mask_where_they_cannot() {
        let posterior = Posterior::new();
        let alpha = |mask: f32, place: f32, precision: f32| {
            posterior.alphas(&[mask; LANES], &[place; LANES], &[precision; LANES])[LANES - 1]
        };
        let sharp = |mask: f32, place: f32| alpha(mask, place, 1000.0);
        for mask in [0.1, 0.5, 0.9] {
            for alpha in [0.0, 0.25, 0.5, 0.75, 1.0] {
                // A pure pixel may be an outlier, so certainty is limited.
                assert!((sharp(mask, alpha) - alpha).abs() < 0.15, "{mask} {alpha}");
            }
        }
        let blunt = |mask: f32, place: f32| alpha(mask, place, 1.0);
        assert!(blunt(0.1, 0.5) < 0.3 && blunt(0.9, 0.5) > 0.7);
        for mask in 0..10 {
            for place in 0..20 {
                let (mask, place) = (mask as f32 / 10.0, MIN_PLACE + place as f32 * 0.08);
                let alpha = sharp(mask, place);
                assert!((0.0..=1.0).contains(&alpha) && sharp(mask + 0.1, place) >= alpha - 1e-6);
            }
        }
    }
}
