//! Temporal prior: where the picture has not changed since the last pair, the last disparity is likely.
//!
//! A textureless wall costs about the same at any disparity, so that noise decides anew in every frame. There a small
//! bonus for the last disparity decides instead. In textured areas the correct disparity is better by more than the
//! bonus, so that moving objects do not keep an old one.
//!
//! twin: shaders/stereo/likely.wgsl

use pulp::{Arch, WithSimd};

use super::super::fixed::{MAX_NOISE, ONE, UNKNOWN};
use crate::compute::bands::Bands;
use crate::compute::thread_pool::{MAX_ITEMS, ThreadPool};

/// Stores the last pair.
#[derive(Debug, Default)]
pub struct TemporalPrior {
    width: usize,
    /// The last left picture; empty before the first.
    luma: Vec<u8>,
    /// The last disparities that passed the left-right consistency check, in fixed point.
    map: Vec<u16>,
    /// One row per band: changes summed over three rows.
    changes: Vec<u16>,
    /// One more than the likely disparity in whole pixels, or 0.
    likely: Vec<u16>,
}

impl TemporalPrior {
    /// Creates a prior without a last pair, for pictures of `width` columns.
    pub fn new(width: usize) -> Self {
        Self { width, ..Self::default() }
    }

    /// Returns one more than the likely disparity of each pixel of the left picture `luma`, in whole pixels, or 0;
    /// `None` before the first pair.
    pub fn find_likely(&mut self, luma: &[u8], workers: &mut ThreadPool) -> Option<&[u16]> {
        if self.luma.len() != luma.len() {
            return None;
        }
        let Self { width, luma: last, map, changes, likely } = self;
        let (width, last, map) = (*width, &**last, &**map);
        let height = luma.len() / width;
        changes.resize(MAX_ITEMS * width, 0);
        likely.resize(luma.len(), 0);
        let bands = Bands::new(height, 1, workers);
        let items = bands.rows().zip(bands.split(likely, width)).zip(changes.chunks_exact_mut(width));
        let arch = Arch::new();
        workers.run_each(items, &|((rows, likely), changes)| {
            for (y, likely) in rows.zip(likely.chunks_exact_mut(width)) {
                let three = [y.saturating_sub(1), y, (y + 1).min(height - 1)];
                let rows = three.map(|y| [luma, last].map(|luma| &luma[y * width..(y + 1) * width]));
                arch.dispatch(LikelyRow { rows, map: &map[y * width..(y + 1) * width], changes, likely });
            }
        });
        Some(likely)
    }

    /// Stores a pair: its left picture, and its disparities in fixed point or [`UNKNOWN`].
    pub fn store_pair(&mut self, luma: &[u8], map: &[u16]) {
        self.luma.clear();
        self.luma.extend_from_slice(luma);
        self.map.clear();
        self.map.extend_from_slice(map);
    }
}

/// Computes the likely disparities of a row.
struct LikelyRow<'a> {
    /// Current and last picture, in this row and those above and below.
    rows: [[&'a [u8]; 2]; 3],
    /// The last disparities.
    map: &'a [u16],
    changes: &'a mut [u16],
    likely: &'a mut [u16],
}

impl WithSimd for LikelyRow<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { rows, map, changes, likely } = self;
        let width = likely.len();
        let (map, changes) = (&map[..width], &mut changes[..width]);
        changes.fill(0);
        for [here, last] in rows {
            let (here, last) = (&here[..width], &last[..width]);
            for x in 0..width {
                changes[x] += u16::from(here[x].max(last[x]) - here[x].min(last[x]));
            }
        }
        let likely_disparity = |d: u16, change: u16| {
            if (change <= MAX_NOISE) & (d != UNKNOWN) { (d.wrapping_add(ONE / 2)) / ONE + 1 } else { 0 }
        };
        let last = width - 1;
        for x in [0, last] {
            let change = changes[x.saturating_sub(1)] + changes[x] + changes[(x + 1).min(last)];
            likely[x] = likely_disparity(map[x], change);
        }
        // Slices of equal length need no bounds checks, so that this loop becomes vector code.
        let inner = width.saturating_sub(2);
        let (before, here, after) =
            (&changes[..inner], &changes[width - inner - 1..][..inner], &changes[width - inner..]);
        let (map, likely) = (&map[width - inner - 1..][..inner], &mut likely[width - inner - 1..][..inner]);
        for x in 0..inner {
            likely[x] = likely_disparity(map[x], before[x] + here[x] + after[x]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_known_and_still_is_likely() {
        let (width, height) = (20, 10);
        let luma: Vec<u8> = (0..width * height).map(|i| (i * 7 % 200) as u8).collect();
        let mut map = vec![5 * ONE + ONE / 2; width * height];
        map[3] = UNKNOWN;
        let mut prior = TemporalPrior::new(width);
        let mut workers = ThreadPool::new("test", 2);
        assert!(prior.find_likely(&luma, &mut workers).is_none(), "before the first pair");
        prior.store_pair(&luma, &map);
        // Noise, and a change at (10, 5).
        let mut next: Vec<u8> = luma.iter().enumerate().map(|(i, &v)| v + (i % 3) as u8).collect();
        next[5 * width + 10] += 50;
        let likely = prior.find_likely(&next, &mut workers).unwrap();
        for (i, &d) in likely.iter().enumerate() {
            let moved = (i % width).abs_diff(10) <= 1 && (i / width).abs_diff(5) <= 1;
            assert_eq!(d, if i == 3 || moved { 0 } else { 7 }, "{i}");
        }
    }
}
