//! The levels of the pyramid of the pass `fill`, some rows at a time.

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use pulp::{Simd, WithSimd};

use super::rows::Rows;
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
            let mut before = f32::INFINITY;
            for x in 0..width {
                known[x] = least(above[x], least(here[x], below[x]));
            }
            for x in 0..last {
                let own = known[x];
                known[x] = least(before, least(own, known[x + 1]));
                before = own;
            }
            known[last] = least(before, known[last]);
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

/// Some rows of a level from the finer one, by half: the sum of four pixels weighed by how far each is known, made a mean
/// where that is more than 1. Less than that adds up from level to level, so that the coarsest one knows something if any
/// pixel does.
pub struct Pull<'a> {
    pub fine: &'a Level,
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
            let (planes, known) = out.split_at_mut((PLANES - 1) * stride);
            let known = &mut known[..width];
            for plane in planes.chunks_exact_mut(stride) {
                let plane = &mut plane[..width];
                for x in 0..width {
                    plane[x] /= if known[x] > 1.0 { known[x] } else { 1.0 };
                }
            }
            for known in known {
                *known = least(*known, 1.0);
            }
        }
    }
}

/// Some rows of a level: what it does not know, from the coarser one, bilinearly: 3/4 of the coarse pixel that covers this
/// one and 1/4 of the neighbour nearest to it, each way.
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
            let [here, there] = beside(y, coarse.height).map(|row| coarse.rows.row(row));
            for x in 0..width {
                let known = out[(PLANES - 1) * stride + x];
                if known >= 1.0 {
                    continue;
                }
                let [near, far] = beside(x, coarse.width);
                let mut values = [0.0; PLANES];
                for (p, value) in values.iter_mut().enumerate() {
                    let (here, there) = (&here[p * coarse.rows.stride..], &there[p * coarse.rows.stride..]);
                    *value =
                        0.75 * (0.75 * here[near] + 0.25 * there[near]) + 0.25 * (0.75 * here[far] + 0.25 * there[far]);
                }
                let scale = (1.0 - known) / values[PLANES - 1].max(1e-6);
                for (p, value) in values.iter().enumerate() {
                    out[p * stride + x] += value * scale;
                }
            }
        }
    }
}

/// The coarse pixel that covers pixel `at`, and the neighbour nearest to it, of `limit`.
#[inline(always)]
fn beside(at: usize, limit: usize) -> [usize; 2] {
    let neighbour = if at.is_multiple_of(2) { (at / 2).saturating_sub(1) } else { at / 2 + 1 };
    [at / 2, neighbour.min(limit - 1)]
}
