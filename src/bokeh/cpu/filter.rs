//! The filters of the pass `blur` for one vector of pixels: along a row, down a column, and what keeps the result in
//! range.
//!
//! A kernel of rank r is `K(y, x) = sum_i v_i(y) h_i(x)` (McGraw 2015, equation 2), so each term is one pass along rows
//! and one down columns: for a kernel of side n, 2 r n taps a pixel instead of n^2. Where every profile is even, taps
//! at -j and j share one multiplication. The loops are written for registers: a value is loaded once and used by all
//! terms of its group, as loads and not multiplications are what these passes wait for.

#![allow(clippy::needless_range_loop)] // Terms and planes index several arrays at once.

use pulp::Simd;

use super::rows::{EDGE_VALUES, STRIP, STRIP_EDGES};
use crate::bokeh::plan::SEGMENT;
use crate::compute::simd::{fma, load};

/// Rows of the result that are filtered at once, where they can share what they read.
pub const BLOCK_ROWS: usize = 4;

/// Clamps coverage to 0..1 and premultiplied colour to the range of colours within reach: truncated filters overshoot.
#[inline(always)]
pub fn keep_in_range<S: Simd>(simd: S, sums: &mut [S::f32s; 4], edges: &[[f32; EDGE_VALUES]; STRIP_EDGES], x: usize) {
    let (left, right) = (&edges[x / SEGMENT], &edges[x / SEGMENT + 1]);
    let across = load::<S>(&ACROSS, x % SEGMENT);
    let coverage = simd.min_f32s(simd.max_f32s(sums[3], simd.splat_f32s(0.0)), simd.splat_f32s(1.0));
    for p in 0..3 {
        let low = lerp(simd, left[1 + p], right[1 + p], across);
        let high = lerp(simd, left[4 + p], right[4 + p], across);
        let at_least = simd.max_f32s(sums[p], simd.mul_f32s(low, coverage));
        sums[p] = simd.min_f32s(at_least, simd.mul_f32s(high, coverage));
    }
    sums[3] = coverage;
}

/// Where each pixel of a segment lies between the segment's edges.
const ACROSS: [f32; SEGMENT] = {
    let mut at = [0.0; SEGMENT];
    let mut k = 0;
    while k < SEGMENT {
        at[k] = (k as f32 + 0.5) / SEGMENT as f32;
        k += 1;
    }
    at
};

/// Linear from `left` to `right` as `across` goes from 0 to 1.
#[inline(always)]
fn lerp<S: Simd>(simd: S, left: f32, right: f32, across: S::f32s) -> S::f32s {
    fma(simd, simd.splat_f32s(right - left), across, simd.splat_f32s(left))
}

/// The taps of a group of `R` terms for one vector of a segment.
pub struct Taps<'a, const R: usize> {
    pub table: &'a [f32],
    /// Where in the table tap 0 of the radius at the left edge of the segment has the group's first term.
    pub left: usize,
    /// The same at the right edge.
    pub right: usize,
    /// From one tap to the next in the table; negative where the aperture is turned.
    pub step: isize,
    pub reach: usize,
    /// Where in the segment the vector begins.
    pub lane: usize,
    /// Whether the taps are the same all along the segment.
    pub steady: bool,
}

impl<const R: usize> Taps<'_, R> {
    /// Tap `j` of every term, per pixel: with `VARY` linear between the segment's edges, else that of the left one.
    #[inline(always)]
    fn at<S: Simd, const VARY: bool>(&self, simd: S, j: isize) -> [S::f32s; R] {
        let left = &self.table[self.left.wrapping_add_signed(j * self.step)..][..R];
        let mut taps = [simd.splat_f32s(0.0); R];
        if VARY {
            let right = &self.table[self.right.wrapping_add_signed(j * self.step)..][..R];
            let across = load::<S>(&ACROSS, self.lane);
            for r in 0..R {
                taps[r] = lerp(simd, left[r], right[r], across);
            }
        } else {
            for r in 0..R {
                taps[r] = simd.splat_f32s(left[r]);
            }
        }
        taps
    }
}

/// The horizontal pass for one vector: every term of the group, every plane. The sums of all terms (at most 4 x 4
/// vectors) stay in registers while the taps go outwards, so that a value that all terms need is read once.
#[inline(always)]
pub fn along_row<S: Simd, const R: usize, const EVEN: bool, const VARY: bool, const P: usize>(
    simd: S,
    taps: &Taps<'_, R>,
    planes: &[&[f32]; 4],
    x: usize,
) -> [[S::f32s; 4]; R] {
    let mut sums = [[simd.splat_f32s(0.0); 4]; R];
    let weights = taps.at::<S, VARY>(simd, 0);
    for p in 0..P {
        let here = load::<S>(planes[p], x);
        for r in 0..R {
            sums[r][p] = simd.mul_f32s(weights[r], here);
        }
    }
    for j in 1..=taps.reach {
        let weights = taps.at::<S, VARY>(simd, j as isize);
        let opposite = if EVEN { weights } else { taps.at::<S, VARY>(simd, -(j as isize)) };
        for p in 0..P {
            let (after, before) = (load::<S>(planes[p], x + j), load::<S>(planes[p], x - j));
            if EVEN {
                let both = simd.add_f32s(after, before);
                for r in 0..R {
                    sums[r][p] = fma(simd, weights[r], both, sums[r][p]);
                }
            } else {
                for r in 0..R {
                    sums[r][p] = fma(simd, opposite[r], before, fma(simd, weights[r], after, sums[r][p]));
                }
            }
        }
    }
    sums
}

/// The vertical pass for one vector of columns and `BLOCK_ROWS` rows from `y` on: `R` terms, `P` planes (3 without
/// coverage, else 4). A tap is one number for all of these pixels, so a row that is read once serves all their sums.
#[inline(always)]
pub fn along_column_block<S: Simd, const R: usize, const P: usize>(
    simd: S,
    taps: &Taps<'_, R>,
    rows: &[f32],
    y: usize,
    x: usize,
    height: usize,
) -> [[S::f32s; 4]; BLOCK_ROWS] {
    let row_len = R * 4 * STRIP;
    let ring_mask = rows.len() / row_len - 1;
    let mut sums = [[simd.splat_f32s(0.0); 4]; BLOCK_ROWS];
    let reach = taps.reach as isize;
    for offset in -reach..BLOCK_ROWS as isize + reach {
        // Beyond the picture its outermost row goes on; rows lie in a ring, a power of two of them.
        let inside = (y as isize + offset).clamp(0, height as isize - 1) as usize;
        let row = &rows[(inside & ring_mask) * row_len..][..row_len];
        for r in 0..R {
            let mut values = [simd.splat_f32s(0.0); P];
            for p in 0..P {
                values[p] = load::<S>(row, (r * 4 + p) * STRIP + x);
            }
            for k in 0..BLOCK_ROWS {
                let j = offset - k as isize;
                if j.abs() <= reach {
                    let weight = simd.splat_f32s(taps.table[taps.left.wrapping_add_signed(j * taps.step) + r]);
                    for p in 0..P {
                        sums[k][p] = fma(simd, weight, values[p], sums[k][p]);
                    }
                }
            }
        }
    }
    sums
}

/// The vertical pass for one vector: the terms of the group summed, every plane. Unlike along a row the terms meet
/// here, so one sum a plane suffices.
#[inline(always)]
pub fn along_column<S: Simd, const R: usize, const EVEN: bool, const VARY: bool, const P: usize>(
    simd: S,
    taps: &Taps<'_, R>,
    rows: &[f32],
    y: usize,
    x: usize,
    height: usize,
) -> [S::f32s; 4] {
    let row_len = R * 4 * STRIP;
    let weights = taps.at::<S, VARY>(simd, 0);
    // Rows lie in a ring, a power of two of them.
    let ring_mask = rows.len() / row_len - 1;
    let here = &rows[(y & ring_mask) * row_len..][..row_len];
    let mut sums = [simd.splat_f32s(0.0); 4];
    for r in 0..R {
        for p in 0..P {
            sums[p] = fma(simd, weights[r], load::<S>(here, (r * 4 + p) * STRIP + x), sums[p]);
        }
    }
    for j in 1..=taps.reach {
        let below = &rows[((y + j).min(height - 1) & ring_mask) * row_len..][..row_len];
        let above = &rows[(y.saturating_sub(j) & ring_mask) * row_len..][..row_len];
        let weights = taps.at::<S, VARY>(simd, j as isize);
        let opposite = if EVEN { weights } else { taps.at::<S, VARY>(simd, -(j as isize)) };
        for r in 0..R {
            for p in 0..P {
                let at = (r * 4 + p) * STRIP + x;
                let (below, above) = (load::<S>(below, at), load::<S>(above, at));
                sums[p] = if EVEN {
                    fma(simd, weights[r], simd.add_f32s(below, above), sums[p])
                } else {
                    fma(simd, opposite[r], above, fma(simd, weights[r], below, sums[p]))
                };
            }
        }
    }
    sums
}
