//! The weight of a pixel in each bin.

/// Weight of a pixel in a bin as a function of CoC: a linear step up at the front border minus one at the rear border.
/// The weights of all bins sum to 1 (partition of unity).
#[derive(Clone, Copy, Debug)]
pub struct BinWeight {
    /// Border to the bin in front: CoC in pixels and slope of the cross-fade.
    pub front: (f32, f32),
    /// Border to the bin behind.
    pub behind: (f32, f32),
}

impl BinWeight {
    /// Creates the function from borders as (CoC, slope of the cross-fade); `None` if there is no bin beyond.
    pub fn new(front: Option<(f32, f32)>, behind: Option<(f32, f32)>) -> Self {
        // Larger than any CoC.
        Self { front: front.unwrap_or((-1e30, 1.0)), behind: behind.unwrap_or((1e30, 1.0)) }
    }

    /// Returns the weight at a CoC, 0 to 1.
    #[inline(always)]
    pub fn at(&self, coc_px: f32) -> f32 {
        linear_step(self.front, coc_px) - linear_step(self.behind, coc_px)
    }

    /// Whether any CoC in a range has a weight above 0.
    pub fn overlaps(&self, (low_px, high_px): (f32, f32)) -> bool {
        linear_step(self.front, high_px) > 0.0 && linear_step(self.behind, low_px) < 1.0
    }
}

/// Linear step from 0 to 1, 0.5 at the border. Comparisons instead of `clamp` compile to single vector instructions.
#[inline(always)]
fn linear_step((border_px, slope): (f32, f32), coc_px: f32) -> f32 {
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
        let bin = |k: usize| BinWeight::new(k.checked_sub(1).map(|k| borders[k]), borders.get(k).copied());
        for step in -200..200 {
            let coc_px = step as f32 * 0.1;
            let sum: f32 = (0..=borders.len()).map(|k| bin(k).at(coc_px)).sum();
            assert!((sum - 1.0).abs() < 1e-6);
            assert!((0..=borders.len()).all(|k| bin(k).at(coc_px) >= 0.0));
            assert!((0..=borders.len()).all(|k| bin(k).at(coc_px) == 0.0 || bin(k).overlaps((coc_px, coc_px))));
        }
    }
}
