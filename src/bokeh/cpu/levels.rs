//! The levels of the pyramid of the pass `fill`, some rows at a time.

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use pulp::{Simd, WithSimd};

use super::rows::{PIECE, Rows};
use crate::bokeh::plan::Share;

/// Planes of a level: premultiplied colour and CoC, and how much of it is known.
pub const PLANES: usize = 5;

/// A picture of the pyramid.
pub struct Level {
    pub width: usize,
    pub height: usize,
    pub rows: Rows<PLANES>,
}

/// Some rows of the finest level, from row `first` on.
pub struct Base<'a> {
    pub halves: &'a Rows<PLANES>,
    pub size: (usize, usize),
    pub unhidden: &'a Share,
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
            // What hides a pixel the most is what is nearest: of three rows, then of three columns.
            let of_rows = &mut planes[..width];
            for x in 0..width {
                of_rows[x] = least(above[x], least(here[x], below[x]));
            }
            known[0] = least(of_rows[0], of_rows[1.min(last)]);
            known[last] = least(of_rows[last.saturating_sub(1)], of_rows[last]);
            for ((known, beside), own) in
                known[1.min(last)..last].iter_mut().zip(&of_rows[2.min(last)..]).zip(of_rows.windows(2))
            {
                *known = least(own[0], least(own[1], *beside));
            }
            for value in known.iter_mut() {
                *value = self.unhidden.at(*value);
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

/// The lesser of two, in one instruction.
#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The CoC of some pixels, and how far they are known: four for each place.
struct Around<const N: usize> {
    coc_px: [[f32; N]; 4],
    known: [[f32; N]; 4],
}

impl<const N: usize> Around<N> {
    /// Keeps of each four either those in front of the subject or the others, whichever are better known, and in a tie those
    /// in front: means of both would be a colour and a CoC that is in neither. Returns how far the kept ones are known, all
    /// together.
    #[inline(always)]
    fn keep_one_side(&mut self, front_px: f32) -> [f32; N] {
        let [mut in_front, mut behind, mut kept] = [[0.0; N]; 3];
        for (known, coc_px) in self.known.iter().zip(&self.coc_px) {
            for x in 0..N {
                in_front[x] += if coc_px[x] < front_px { known[x] } else { 0.0 };
                behind[x] += if coc_px[x] < front_px { 0.0 } else { known[x] };
            }
        }
        for (known, coc_px) in self.known.iter_mut().zip(&self.coc_px) {
            for x in 0..N {
                let front = in_front[x] > 0.99 * behind[x];
                known[x] = if front == (coc_px[x] < front_px) { known[x] } else { 0.0 };
                kept[x] += known[x];
            }
        }
        kept
    }
}

/// Some rows of a level from the finer one, by half: the sum of four pixels on one side of the subject weighed by how far each is known,
/// made a mean where that is more than 1. Less than that adds up from level to level, so that the coarsest one knows something
/// if any pixel does.
pub struct Pull<'a> {
    pub fine: &'a Level,
    /// What has a CoC below this lies in front of the subject.
    pub front_px: f32,
    /// The first row, and the rows' planes.
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
            let rows = [Some(fine.rows.row(2 * y)), (2 * y + 1 < fine.height).then(|| fine.rows.row(2 * y + 1))];
            for first in (0..width).step_by(PIECE) {
                let count = PIECE.min(width - first);
                // Of plane `p`, the four pixels under each coarse one.
                let pixels = |p: usize| {
                    let mut pixels = [[0.0; PIECE]; 4];
                    for (row, pixels) in rows.iter().zip(pixels.as_chunks_mut::<2>().0) {
                        let Some(row) = row else { continue };
                        let pairs = &row[p * fine.rows.stride..].as_chunks::<2>().0[first..first + count];
                        let [left, right] = pixels;
                        for ((left, right), pair) in left.iter_mut().zip(right).zip(pairs) {
                            (*left, *right) = (pair[0], pair[1]);
                        }
                    }
                    pixels
                };
                let mut around = Around { coc_px: pixels(PLANES - 2), known: pixels(PLANES - 1) };
                let all = around.known;
                let mut inverse = [[0.0; PIECE]; 4];
                for k in 0..4 {
                    for x in 0..PIECE {
                        inverse[k][x] = 1.0 / if all[k][x] > 1e-6 { all[k][x] } else { 1e-6 };
                        around.coc_px[k][x] *= inverse[k][x];
                    }
                }
                let mut sum = around.keep_one_side(self.front_px);
                for k in 0..4 {
                    for x in 0..PIECE {
                        inverse[k][x] *= around.known[k][x] / if sum[x] > 1.0 { sum[x] } else { 1.0 };
                    }
                }
                for p in 0..PLANES - 1 {
                    let (pixels, mut mean) = (pixels(p), [0.0; PIECE]);
                    for k in 0..4 {
                        for x in 0..PIECE {
                            mean[x] += pixels[k][x] * inverse[k][x];
                        }
                    }
                    out[p * stride + first..][..count].copy_from_slice(&mean[..count]);
                }
                for known in &mut sum {
                    *known = least(*known, 1.0);
                }
                out[(PLANES - 1) * stride + first..][..count].copy_from_slice(&sum[..count]);
            }
        }
    }
}

/// Some rows of a level: what it does not know, from the coarser one, on one side of the subject, bilinearly: 3/4 of the coarse pixel that
/// covers this one and 1/4 of the neighbour nearest to it, each way.
pub struct Push<'a> {
    pub coarse: &'a Level,
    pub front_px: f32,
    pub first: usize,
    pub rows: &'a mut [f32],
    pub stride: usize,
    pub width: usize,
}

impl WithSimd for Push<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        const WIDE: usize = 2 * PIECE;
        let Self { coarse, width, stride, .. } = self;
        for (y, out) in (self.first..).zip(self.rows.chunks_exact_mut(stride * PLANES)) {
            let rows = beside(y, coarse.height).map(|row| coarse.rows.row(row));
            for first in (0..width).step_by(WIDE) {
                let count = WIDE.min(width - first);
                let mut open = [0.0; WIDE];
                let known = &out[(PLANES - 1) * stride + first..][..count];
                for (open, known) in open.iter_mut().zip(known) {
                    *open = if *known < 1.0 { 1.0 - *known } else { 0.0 };
                }
                if open.iter().all(|&open| open <= 0.0) {
                    continue;
                }
                // Of plane `p`, the four coarse pixels around each.
                let pixels = |p: usize| {
                    let plane = p * coarse.rows.stride..p * coarse.rows.stride + coarse.width;
                    let [[a, b], [c, d]] = rows.map(|row| around(&row[plane.clone()], first / 2));
                    [a, b, c, d]
                };
                let mut around = Around { coc_px: pixels(PLANES - 2), known: pixels(PLANES - 1) };
                let mut weights = [[0.0; WIDE]; 4];
                for (k, bilinear) in [9.0 / 16.0, 3.0 / 16.0, 3.0 / 16.0, 1.0 / 16.0].into_iter().enumerate() {
                    for x in 0..WIDE {
                        let inverse = 1.0 / if around.known[k][x] > 1e-6 { around.known[k][x] } else { 1e-6 };
                        around.coc_px[k][x] *= inverse;
                        around.known[k][x] *= bilinear;
                        weights[k][x] = inverse;
                    }
                }
                let sum = around.keep_one_side(self.front_px);
                for k in 0..4 {
                    for x in 0..WIDE {
                        weights[k][x] *= around.known[k][x] * open[x] / if sum[x] > 1e-6 { sum[x] } else { 1e-6 };
                    }
                }
                for p in 0..PLANES {
                    let (pixels, mut mean) = (pixels(p), [0.0; WIDE]);
                    for k in 0..4 {
                        for x in 0..WIDE {
                            mean[x] += pixels[k][x] * weights[k][x];
                        }
                    }
                    for (out, mean) in out[p * stride + first..][..count].iter_mut().zip(&mean) {
                        *out += mean;
                    }
                }
            }
        }
    }
}

/// The coarse pixel that covers each of two fine ones, for [`PIECE`] coarse ones from column `first` on, and the neighbour
/// nearest to that. Outside, the outermost repeat.
#[inline(always)]
fn around(row: &[f32], first: usize) -> [[f32; 2 * PIECE]; 2] {
    let mut line = [0.0; PIECE + 2];
    if first > 0 && first + PIECE < row.len() {
        line.copy_from_slice(&row[first - 1..][..PIECE + 2]);
    } else {
        for (k, value) in line.iter_mut().enumerate() {
            *value = row[(first + k).saturating_sub(1).min(row.len() - 1)];
        }
    }
    let mut values = [[0.0; 2 * PIECE]; 2];
    for k in 0..PIECE {
        (values[0][2 * k], values[0][2 * k + 1]) = (line[k + 1], line[k + 1]);
        (values[1][2 * k], values[1][2 * k + 1]) = (line[k], line[k + 2]);
    }
    values
}

/// The coarse row that covers row `at`, and the neighbour nearest to it, of `limit`.
#[inline(always)]
fn beside(at: usize, limit: usize) -> [usize; 2] {
    let neighbour = if at.is_multiple_of(2) { (at / 2).saturating_sub(1) } else { at / 2 + 1 };
    [at / 2, neighbour.min(limit - 1)]
}
