//! Kernels of the image pyramid of the pass `fill`, some rows at a time (pull-push).
//!
//! twin: shaders/blur/pyramid.wgsl, pull.wgsl, coarse.wgsl

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use pulp::{Simd, WithSimd};

use super::rows::{COPY_WIDTH, PlanarRows};
use crate::bokeh::plan::BinWeight;

/// Planes of a level: premultiplied colour and CoC, and the known weight.
pub const PLANES: usize = 5;

/// One level of the pyramid.
pub struct Level {
    pub width: usize,
    pub height: usize,
    pub rows: PlanarRows<PLANES>,
}

/// Computes some rows of the finest level, from row `first` on.
pub struct Base<'a> {
    pub halves: &'a PlanarRows<PLANES>,
    pub size: (usize, usize),
    pub visible_weight: &'a BinWeight,
    pub first: usize,
    pub rows: &'a mut [f32],
}

impl WithSimd for Base<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let ((width, height), stride) = (self.size, self.halves.stride);
        for (y, planes) in (self.first..).zip(self.rows.chunks_exact_mut(self.halves.row_len())) {
            let (planes, known) = planes.split_at_mut((PLANES - 1) * stride);
            let (known, last) = (&mut known[..width], width - 1);
            let nearest = |y: usize| &self.halves.row(y)[(PLANES - 1) * stride..][..width];
            let (above, here, below) = (nearest(y.saturating_sub(1)), nearest(y), nearest((y + 1).min(height - 1)));
            // The smallest CoC of the 3x3 neighbourhood decides: minimum over three rows, then over three columns.
            let column_minima = &mut planes[..width];
            for x in 0..width {
                column_minima[x] = fast_min(above[x], fast_min(here[x], below[x]));
            }
            known[0] = fast_min(column_minima[0], column_minima[1.min(last)]);
            known[last] = fast_min(column_minima[last.saturating_sub(1)], column_minima[last]);
            for ((known, beside), own) in
                known[1.min(last)..last].iter_mut().zip(&column_minima[2.min(last)..]).zip(column_minima.windows(2))
            {
                *known = fast_min(own[0], fast_min(own[1], *beside));
            }
            for value in known.iter_mut() {
                *value = self.visible_weight.at(*value);
            }
            for p in 0..PLANES - 1 {
                let (plane, own) = (&mut planes[p * stride..][..width], &self.halves.row(y)[p * stride..][..width]);
                for x in 0..width {
                    plane[x] = own[x] * known[x];
                }
            }
        }
    }
}

/// Returns the minimum, in one instruction.
#[inline(always)]
fn fast_min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Pull: some rows of a level at half the finer level's size. The sum of four pixels weighted by their known weights,
/// divided by the total where it is above 1. Smaller totals accumulate from level to level, so that the coarsest level
/// is known if any pixel is.
pub struct Pull<'a> {
    pub fine: &'a Level,
    /// First row of `rows`.
    pub first: usize,
    pub rows: &'a mut [f32],
    pub stride: usize,
    pub width: usize,
}

impl WithSimd for Pull<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { fine, width, stride, .. } = self;
        for (y, out) in (self.first..).zip(self.rows.chunks_exact_mut(stride * PLANES)) {
            let (above, below) = (fine.rows.row(2 * y), (2 * y + 1 < fine.height).then(|| fine.rows.row(2 * y + 1)));
            for p in 0..PLANES {
                let out = &mut out[p * stride..][..width];
                let above = &above[p * fine.rows.stride..].as_chunks::<2>().0[..width];
                for x in 0..width {
                    out[x] = above[x][0] + above[x][1];
                }
                if let Some(below) = below {
                    let below = &below[p * fine.rows.stride..].as_chunks::<2>().0[..width];
                    for x in 0..width {
                        out[x] += below[x][0] + below[x][1];
                    }
                }
            }
            // Sums become means only where more than one pixel is known.
            let (planes, known) = out.split_at_mut((PLANES - 1) * stride);
            let known = &mut known[..width];
            for plane in planes.chunks_exact_mut(stride) {
                let plane = &mut plane[..width];
                for x in 0..width {
                    plane[x] /= if known[x] > 1.0 { known[x] } else { 1.0 };
                }
            }
            for known in known {
                *known = fast_min(*known, 1.0);
            }
        }
    }
}

/// Push: fills the unknown part of some rows of a level bilinearly from the coarser one: per axis, 3/4 of the coarse
/// pixel that covers this one and 1/4 of its nearest neighbour.
pub struct Push<'a> {
    pub coarse: &'a Level,
    pub first: usize,
    pub rows: &'a mut [f32],
    pub stride: usize,
    pub width: usize,
}

impl WithSimd for Push<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { coarse, width, stride, .. } = self;
        for (y, out) in (self.first..).zip(self.rows.chunks_exact_mut(stride * PLANES)) {
            let [here, there] = interpolation_rows(y, coarse.height).map(|row| coarse.rows.row(row));
            for first in (0..width).step_by(2 * COPY_WIDTH) {
                let count = (2 * COPY_WIDTH).min(width - first);
                // Unknown fraction of each pixel; most pixels are known completely.
                let mut unknown = [0.0; 2 * COPY_WIDTH];
                let known = &out[(PLANES - 1) * stride + first..][..count];
                for (unknown, known) in unknown.iter_mut().zip(known) {
                    *unknown = if *known < 1.0 { 1.0 - *known } else { 0.0 };
                }
                if unknown.iter().all(|&unknown| unknown <= 0.0) {
                    continue;
                }
                let mut values = [[0.0; 2 * COPY_WIDTH]; PLANES];
                for (p, values) in values.iter_mut().enumerate() {
                    let plane = p * coarse.rows.stride..p * coarse.rows.stride + coarse.width;
                    interpolate_rows(&here[plane.clone()], &there[plane], first / 2, values);
                }
                let mut scale = [0.0; 2 * COPY_WIDTH];
                for x in 0..2 * COPY_WIDTH {
                    let sum = values[PLANES - 1][x];
                    scale[x] = unknown[x] / if sum > 1e-6 { sum } else { 1e-6 };
                }
                for (p, values) in values.iter().enumerate() {
                    let out = &mut out[p * stride + first..][..count];
                    for ((out, value), scale) in out.iter_mut().zip(values).zip(&scale) {
                        *out += value * scale;
                    }
                }
            }
        }
    }
}

/// Interpolates two pixels for each of [`COPY_WIDTH`] coarse ones from column `first` on, between the rows `here` and
/// `there`.
#[inline(always)]
fn interpolate_rows(here: &[f32], there: &[f32], first: usize, values: &mut [f32; 2 * COPY_WIDTH]) {
    // One more on both sides; outside, the outermost pixels repeat.
    let mut rows = [[0.0; COPY_WIDTH + 2]; 2];
    for (row, line) in rows.iter_mut().zip([here, there]) {
        if first > 0 && first + COPY_WIDTH < line.len() {
            row.copy_from_slice(&line[first - 1..][..COPY_WIDTH + 2]);
        } else {
            for (k, value) in row.iter_mut().enumerate() {
                *value = line[(first + k).saturating_sub(1).min(line.len() - 1)];
            }
        }
    }
    let mut column = [0.0; COPY_WIDTH + 2];
    for k in 0..COPY_WIDTH + 2 {
        column[k] = 0.75 * rows[0][k] + 0.25 * rows[1][k];
    }
    for k in 0..COPY_WIDTH {
        values[2 * k] = 0.75 * column[k + 1] + 0.25 * column[k];
        values[2 * k + 1] = 0.75 * column[k + 1] + 0.25 * column[k + 2];
    }
}

/// Returns the coarse row that covers row `at`, and its nearest neighbour, clamped to `limit` rows.
#[inline(always)]
fn interpolation_rows(at: usize, limit: usize) -> [usize; 2] {
    let neighbour = if at.is_multiple_of(2) { (at / 2).saturating_sub(1) } else { at / 2 + 1 };
    [at / 2, neighbour.min(limit - 1)]
}
