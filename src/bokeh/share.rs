//! Which bin takes how much of a pixel.

/// How much of a pixel with a given CoC a bin takes: a step up at the border in front, a step down at the one behind.
#[derive(Clone, Copy, Debug)]
pub struct Share {
    /// Border to the bin in front: CoC in pixels and slope of the hand-over.
    pub front: (f32, f32),
    /// Border to the bin behind.
    pub behind: (f32, f32),
}

impl Share {
    /// Borders as CoC and slope of the hand-over; `None` where there is no bin beyond.
    pub fn new(front: Option<(f32, f32)>, behind: Option<(f32, f32)>) -> Self {
        // Beyond any CoC.
        Self { front: front.unwrap_or((-1e30, 1.0)), behind: behind.unwrap_or((1e30, 1.0)) }
    }

    /// The share at a CoC, 0 to 1; the shares of all bins of a plan sum to 1.
    #[inline(always)]
    pub fn at(&self, coc_px: f32) -> f32 {
        step(self.front, coc_px) - step(self.behind, coc_px)
    }

    /// Whether any CoC in a range has a share above 0.
    pub fn meets(&self, (low_px, high_px): (f32, f32)) -> bool {
        step(self.front, high_px) > 0.0 && step(self.behind, low_px) < 1.0
    }
}

/// A linear step from 0 to 1, 0.5 at the border. Comparisons instead of `clamp` become single vector instructions.
#[inline(always)]
fn step((border_px, slope): (f32, f32), coc_px: f32) -> f32 {
    let value = (coc_px - border_px) * slope + 0.5;
    let value = if value > 0.0 { value } else { 0.0 };
    if value < 1.0 { value } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shares_of_all_bins_sum_to_one() {
        let borders = [(-7.0, 0.5), (-1.0, 3.0), (1.0, 3.0), (4.0, 0.8)];
        let bin = |k: usize| Share::new(k.checked_sub(1).map(|k| borders[k]), borders.get(k).copied());
        for step in -200..200 {
            let coc_px = step as f32 * 0.1;
            let sum: f32 = (0..=borders.len()).map(|k| bin(k).at(coc_px)).sum();
            assert!((sum - 1.0).abs() < 1e-6);
            assert!((0..=borders.len()).all(|k| bin(k).at(coc_px) >= 0.0));
            assert!((0..=borders.len()).all(|k| bin(k).at(coc_px) == 0.0 || bin(k).meets((coc_px, coc_px))));
        }
    }
}
