//! The filter kernels of the pass `blur` for one vector of pixels: along a row, down a column, and the clamp of the
//! result.
//!
//! A kernel of rank r is `K(y, x) = sum_i v_i(y) h_i(x)` (McGraw 2015, equation 2), so each term is one pass along rows
//! and one down columns: for a kernel of side n, 2 r n taps a pixel instead of n^2. If every profile is symmetric, taps
//! at -j and j share one multiplication. The loops are written for registers: a value is loaded once and used by all
//! terms of its group, because the loads limit these passes, not the multiplications.
//!
//! twin: shaders/blur/filter.wgsl, shaders/blur/blur_rows.wgsl, shaders/blur/blur_columns.wgsl

#![allow(clippy::needless_range_loop)] // Terms and planes index several arrays at once.

use pulp::Simd;

use super::rows::{COPY_WIDTH, EDGE_VALUES, STRIP, STRIP_EDGES, STRIP_ROW};
use crate::bokeh::plan::SEGMENT;
use crate::compute::simd::{fma, load};

/// Rows of the result that are filtered at once, if they can share loads.
pub const BLOCK_ROWS: usize = 4;

/// Whether there are too few registers for a block's sums of all planes: AVX2 has half as many as the others.
#[inline(always)]
fn has_few_registers<S: Simd>() -> bool {
    S::F32_LANES == 8
}

/// Returns the values from one row to the next between both passes: `[term][4][STRIP]`. If the planes are read one
/// after the other down the rows, a cache line is added, because a power of two would map the rows to few sets of the
/// nearest cache.
#[inline(always)]
pub fn row_len<S: Simd>(terms: usize) -> usize {
    if has_few_registers::<S>() { max_row_len(terms) } else { terms * STRIP_ROW }
}

/// Upper bound of [`row_len`] on any processor.
pub fn max_row_len(terms: usize) -> usize {
    terms * STRIP_ROW + COPY_WIDTH
}

/// Clamps coverage to 0..1 and premultiplied colour to the range of colours within the filter support: truncated
/// filters overshoot.
#[inline(always)]
pub fn clamp_to_range<S: Simd>(simd: S, sums: &mut [S::f32s; 4], edges: &[[f32; EDGE_VALUES]; STRIP_EDGES], x: usize) {
    let (left, right) = (&edges[x / SEGMENT], &edges[x / SEGMENT + 1]);
    let across = load::<S>(&SEGMENT_POSITIONS, x % SEGMENT);
    let coverage = simd.min_f32s(simd.max_f32s(sums[3], simd.splat_f32s(0.0)), simd.splat_f32s(1.0));
    for p in 0..3 {
        let low = lerp(simd, left[1 + p], right[1 + p], across);
        let high = lerp(simd, left[4 + p], right[4 + p], across);
        let at_least = simd.max_f32s(sums[p], simd.mul_f32s(low, coverage));
        sums[p] = simd.min_f32s(at_least, simd.mul_f32s(high, coverage));
    }
    sums[3] = coverage;
}

/// Position of each pixel between the edges of its segment, 0 to 1.
const SEGMENT_POSITIONS: [f32; SEGMENT] = {
    let mut at = [0.0; SEGMENT];
    let mut k = 0;
    while k < SEGMENT {
        at[k] = (k as f32 + 0.5) / SEGMENT as f32;
        k += 1;
    }
    at
};

/// Interpolates linearly from `left` to `right` as `across` goes from 0 to 1.
#[inline(always)]
fn lerp<S: Simd>(simd: S, left: f32, right: f32, across: S::f32s) -> S::f32s {
    fma(simd, simd.splat_f32s(right - left), across, simd.splat_f32s(left))
}

/// Taps of a group of `R` terms for one vector of a segment.
pub struct Taps<'a, const R: usize> {
    pub table: &'a [f32],
    /// Index in the table of tap 0 and the group's first term, for the radius at the left edge of the segment.
    pub left: usize,
    /// Same index for the right edge.
    pub right: usize,
    /// Table entries from one tap to the next; negative if the aperture is turned.
    pub step: isize,
    /// Outermost tap.
    pub half_width: usize,
    /// First pixel of the vector within the segment.
    pub lane: usize,
    /// Whether the taps are constant along the segment.
    pub is_constant: bool,
}

impl<const R: usize> Taps<'_, R> {
    /// Returns tap `j` of every term, per pixel: with `VARY` linear between the segment's edges, else that of the left
    /// edge.
    #[inline(always)]
    fn at<S: Simd, const VARY: bool>(&self, simd: S, j: isize) -> [S::f32s; R] {
        let left = &self.table[self.left.wrapping_add_signed(j * self.step)..][..R];
        let mut taps = [simd.splat_f32s(0.0); R];
        if VARY {
            let right = &self.table[self.right.wrapping_add_signed(j * self.step)..][..R];
            let across = load::<S>(&SEGMENT_POSITIONS, self.lane);
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

/// Filters one vector horizontally: every term of the group, every plane. The sums of all terms (at most 4 x 4 vectors)
/// stay in registers while the taps go outwards, so that a value is loaded once for all terms.
#[inline(always)]
pub fn filter_row<S: Simd, const R: usize, const SYMMETRIC: bool, const VARY: bool, const P: usize>(
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
    for j in 1..=taps.half_width {
        let weights = taps.at::<S, VARY>(simd, j as isize);
        let opposite = if SYMMETRIC { weights } else { taps.at::<S, VARY>(simd, -(j as isize)) };
        for p in 0..P {
            let (after, before) = (load::<S>(planes[p], x + j), load::<S>(planes[p], x - j));
            if SYMMETRIC {
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

/// Filters one vector of columns and `BLOCK_ROWS` rows from `y` on vertically: `R` terms, `P` planes (3 without
/// coverage, else 4). The taps are equal for all of these pixels, so a row is loaded once for all their sums.
#[inline(always)]
pub fn filter_column_block<S: Simd, const R: usize, const SYMMETRIC: bool, const P: usize>(
    simd: S,
    taps: &Taps<'_, R>,
    rows: &[f32],
    y: usize,
    x: usize,
    height: usize,
) -> [[S::f32s; 4]; BLOCK_ROWS] {
    if SYMMETRIC && has_few_registers::<S>() && y >= taps.half_width && y + BLOCK_ROWS + taps.half_width <= height {
        return filter_column_planes::<S, R, P>(simd, taps, rows, y, x);
    }
    let row_len = row_len::<S>(R);
    let ring_mask = rows.len() / row_len - 1;
    let mut sums = [[simd.splat_f32s(0.0); 4]; BLOCK_ROWS];
    let half_width = taps.half_width as isize;
    for offset in -half_width..BLOCK_ROWS as isize + half_width {
        // Beyond the picture its outermost row repeats; rows are in a ring whose size is a power of two.
        let inside = (y as isize + offset).clamp(0, height as isize - 1) as usize;
        let row = &rows[(inside & ring_mask) * row_len..][..row_len];
        for r in 0..R {
            let mut values = [simd.splat_f32s(0.0); P];
            for p in 0..P {
                values[p] = load::<S>(row, (r * 4 + p) * STRIP + x);
            }
            for k in 0..BLOCK_ROWS {
                let j = offset - k as isize;
                if j.abs() <= half_width {
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

/// Variant of [`filter_column_block`] for symmetric profiles, plane by plane, if the taps stay inside the picture: as
/// they go outwards, `BLOCK_ROWS` rows above and below stay in registers, and one more of each is loaded.
#[inline(always)]
fn filter_column_planes<S: Simd, const R: usize, const P: usize>(
    simd: S,
    taps: &Taps<'_, R>,
    rows: &[f32],
    y: usize,
    x: usize,
) -> [[S::f32s; 4]; BLOCK_ROWS] {
    const N: usize = BLOCK_ROWS;
    let row_len = row_len::<S>(R);
    let ring_mask = rows.len() / row_len - 1;
    let mut all = [[simd.splat_f32s(0.0); 4]; N];
    for r in 0..R {
        let weight = |j: usize| simd.splat_f32s(taps.table[taps.left.wrapping_add_signed(j as isize * taps.step) + r]);
        for p in 0..P {
            let value = |y: usize| load::<S>(rows, (y & ring_mask) * row_len + (r * 4 + p) * STRIP + x);
            // At tap j, output row `y + k` needs the rows `y + k - j` and `y + k + j`. One tap further out, one row on
            // each side is new: it overwrites the one that is no longer needed. So that no register is moved, row
            // `y + i` stays at index `i` modulo `N`, and rotated indices, which are constant once unrolled, find it.
            let mut above = [value(y), value(y + 1), value(y + 2), value(y + 3)];
            let mut below = above;
            let mut sums = above;
            let here = weight(0);
            for k in 0..N {
                sums[k] = fma(simd, here, above[k], all[k][p]);
            }
            for first in (1..=taps.half_width).step_by(N) {
                for i in 0..N.min(taps.half_width + 1 - first) {
                    let j = first + i;
                    above[N - 1 - i] = value(y - j);
                    below[i] = value(y + N - 1 + j);
                    let weight = weight(j);
                    for k in 0..N {
                        // Rows `y + k - j` and `y + k + j`, because `j` is `i + 1` modulo `N`.
                        let both = simd.add_f32s(above[(k + N - 1 - i) % N], below[(k + 1 + i) % N]);
                        sums[k] = fma(simd, weight, both, sums[k]);
                    }
                }
            }
            for k in 0..N {
                all[k][p] = sums[k];
            }
        }
    }
    all
}

/// Filters one vector vertically: the terms of the group summed, every plane. Unlike along a row, the terms are added
/// here, so one sum per plane suffices.
#[inline(always)]
pub fn filter_column<S: Simd, const R: usize, const SYMMETRIC: bool, const VARY: bool, const P: usize>(
    simd: S,
    taps: &Taps<'_, R>,
    rows: &[f32],
    y: usize,
    x: usize,
    height: usize,
) -> [S::f32s; 4] {
    let row_len = row_len::<S>(R);
    let weights = taps.at::<S, VARY>(simd, 0);
    // Rows are in a ring whose size is a power of two.
    let ring_mask = rows.len() / row_len - 1;
    let here = &rows[(y & ring_mask) * row_len..][..row_len];
    let mut sums = [simd.splat_f32s(0.0); 4];
    for r in 0..R {
        for p in 0..P {
            sums[p] = fma(simd, weights[r], load::<S>(here, (r * 4 + p) * STRIP + x), sums[p]);
        }
    }
    for j in 1..=taps.half_width {
        let below = &rows[((y + j).min(height - 1) & ring_mask) * row_len..][..row_len];
        let above = &rows[(y.saturating_sub(j) & ring_mask) * row_len..][..row_len];
        let weights = taps.at::<S, VARY>(simd, j as isize);
        let opposite = if SYMMETRIC { weights } else { taps.at::<S, VARY>(simd, -(j as isize)) };
        for r in 0..R {
            for p in 0..P {
                let at = (r * 4 + p) * STRIP + x;
                let (below, above) = (load::<S>(below, at), load::<S>(above, at));
                sums[p] = if SYMMETRIC {
                    fma(simd, weights[r], simd.add_f32s(below, above), sums[p])
                } else {
                    fma(simd, opposite[r], above, fma(simd, weights[r], below, sums[p]))
                };
            }
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use pulp::{Arch, WithSimd};

    use super::*;
    use crate::compute::aligned::Aligned;

    const HEIGHT: usize = 60;

    /// Compares filtering a block of rows with filtering its rows one by one, at the ends of the picture and between.
    struct Compare {
        half_width: usize,
    }

    impl WithSimd for Compare {
        type Output = ();
        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            const R: usize = 2;
            let number = |k: usize| (k as u32).wrapping_mul(0x9e37_79b1) as f32 / 4.3e9;
            let (half_width, width) = (self.half_width, row_len::<S>(R));
            let mut rows = Aligned::zeros(HEIGHT.next_power_of_two() * width);
            rows.iter_mut().enumerate().for_each(|(k, value)| *value = number(k));
            let table: Vec<f32> = (0..2 * half_width + 1)
                .flat_map(|j| [j.abs_diff(half_width), 99 + j.abs_diff(half_width)])
                .map(number)
                .collect();
            let (left, step) = (half_width * R, R as isize);
            let taps = Taps::<R> { table: &table, left, right: left, step, half_width, lane: 0, is_constant: true };
            for y in (0..HEIGHT).step_by(BLOCK_ROWS) {
                for x in (0..STRIP).step_by(S::F32_LANES) {
                    let block = filter_column_block::<S, R, true, 3>(simd, &taps, &rows, y, x, HEIGHT);
                    for (k, sums) in block.iter().enumerate() {
                        let row = filter_column::<S, R, true, false, 3>(simd, &taps, &rows, y + k, x, HEIGHT);
                        for p in 0..3 {
                            let apart = simd.abs_f32s(simd.sub_f32s(sums[p], row[p]));
                            let apart = simd.reduce_max_f32s(apart);
                            assert!(apart < 1e-4, "reach {half_width}, row {}, column {x}, plane {p}: {apart}", y + k);
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_block_of_rows_is_filtered_as_each_of_them_on_every_processor() {
        for half_width in [0, 1, 2, 3, 4, 5, 7, 16, 28] {
            Arch::new().dispatch(Compare { half_width });
            Arch::Scalar.dispatch(Compare { half_width });
            #[cfg(target_arch = "x86_64")]
            if let Some(avx2) = pulp::x86::V3::try_new() {
                Arch::V3(avx2).dispatch(Compare { half_width });
            }
        }
    }
}
