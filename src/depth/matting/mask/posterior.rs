//! The share of a pixel, given what a mask says of it and where its colour lies between those of two surfaces.

/// Shares are tried in steps of an eighth.
const STEPS: usize = 9;
/// So likely a pixel is mixed where the mask is undecided, any share being as likely as another; the less, the surer it is,
/// so that the mean share is close to the mask where colours tell nothing.
const MIXED: f32 = 0.25;
/// No mask is surer than this.
const MOST_SURE: f32 = 0.985;
/// Surfaces have spots that no pixel around is like: so likely a pure pixel is one, times what evens out densities.
const OUTLIER: f32 = 0.05;

/// Entries of the table: values of the mask, places of the colour from [`LEAST`] on in steps of [`STEP`], and precisions,
/// each twice the last.
const MASKS: usize = 33;
const PLACES: usize = 65;
const LEAST: f32 = -0.3;
const STEP: f32 = (1.3 - LEAST) / (PLACES - 1) as f32;
const PRECISIONS: usize = 11;

/// The mean share by mask, place and precision.
#[derive(Debug)]
pub struct Posterior(Vec<f32>);

impl Posterior {
    pub fn new() -> Self {
        let mut table = Vec::with_capacity(PRECISIONS * MASKS * PLACES);
        for precision in (0..PRECISIONS).map(|k| (1u32 << k) as f32) {
            for mask in (0..MASKS).map(|k| k as f32 / (MASKS - 1) as f32) {
                table.extend((0..PLACES).map(|k| mean_share(mask, LEAST + STEP * k as f32, precision)));
            }
        }
        Self(table)
    }

    /// The share where the mask has `mask`, 0 to 1, and the colour lies at `place`: 0 for the far surface's, 1 for the near
    /// one's, with `precision`, the reciprocal variance of that.
    #[inline(always)]
    pub fn share(&self, mask: f32, place: f32, precision: f32) -> f32 {
        // The exponent of a float is its binary logarithm, rounded down.
        let exponent = (std::f32::consts::SQRT_2 * precision.max(1.0)).to_bits() >> (f32::MANTISSA_DIGITS - 1);
        let slice = (exponent as usize - 127).min(PRECISIONS - 1);
        let row = (mask * (MASKS - 1) as f32 + 0.5) as usize;
        let at = ((place - LEAST) * (1.0 / STEP)).clamp(0.0, (PLACES - 1) as f32 - 1e-3);
        let (first, along) = (at as usize, at.fract());
        let row = &self.0[(slice * MASKS + row.min(MASKS - 1)) * PLACES..][..PLACES];
        row[first] + (row[first + 1] - row[first]) * along
    }
}

impl Default for Posterior {
    fn default() -> Self {
        Self::new()
    }
}

fn mean_share(mask: f32, place: f32, precision: f32) -> f32 {
    let mask = mask.clamp(1.0 - MOST_SURE, MOST_SURE);
    let mixed = MIXED * 4.0 * mask * (1.0 - mask);
    let (mut sum, mut all) = (0.0, 0.0);
    for step in 0..STEPS {
        let share = step as f32 / (STEPS - 1) as f32;
        let likelihood = (-0.5 * precision * (place - share) * (place - share)).exp();
        let (prior, likelihood) = match step {
            0 => ((1.0 - mixed) * (1.0 - mask), likelihood.max(OUTLIER / precision.sqrt())),
            _ if step == STEPS - 1 => ((1.0 - mixed) * mask, likelihood.max(OUTLIER / precision.sqrt())),
            _ => (0.0, likelihood),
        };
        let weight = (prior + mixed / STEPS as f32) * likelihood;
        (sum, all) = (sum + weight * share, all + weight);
    }
    sum / all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_decide_where_they_can_and_the_mask_where_they_cannot() {
        let posterior = Posterior::new();
        let sharp = |mask: f32, place: f32| posterior.share(mask, place, 1000.0);
        for mask in [0.1, 0.5, 0.9] {
            for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
                // A pure pixel may be a spot of another colour: that stays possible.
                assert!((sharp(mask, share) - share).abs() < 0.15, "{mask} {share}");
            }
        }
        let blunt = |mask: f32, place: f32| posterior.share(mask, place, 1.0);
        assert!(blunt(0.1, 0.5) < 0.3 && blunt(0.9, 0.5) > 0.7);
        for mask in 0..10 {
            for place in 0..20 {
                let (mask, place) = (mask as f32 / 10.0, LEAST + place as f32 * 0.08);
                let share = sharp(mask, place);
                assert!((0.0..=1.0).contains(&share) && sharp(mask + 0.1, place) >= share - 1e-6);
            }
        }
    }
}
