//! Pass `composite` where one bin shows alone: it is encoded at its own scale, and the codes are enlarged, with linear
//! interpolation. What a blur lets through is so smooth that the interpolated codes are those of interpolated light.

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use std::ops::Range;

use pulp::Simd;

use super::encode::{CHUNK, codes_of};
use super::rows::{STRIP, STRIP_ROW, Slot};
use super::tiles::TILE_H;
use super::unpack::compression_factor;
use crate::bokeh::plan::{Bin, MIN_COVERAGE};
use crate::color::luminance;
use crate::compute::aligned::CacheAligned;
use crate::compute::simd::{madd, round_to_integer};

/// Bin pixels across a chunk at the finest reduced scale, and one more on both sides.
const ACROSS: usize = CHUNK / 2 + 16;
/// Columns before the first one of a chunk.
const BEFORE: usize = 8;
/// Rows of a bin that a row of tiles shows, at most.
const ROWS: usize = TILE_H / 2 + 2;

/// A row of a bin in a chunk, as codes: r, g, b.
type CodeRow = CacheAligned<[[f32; ACROSS]; 3]>;

/// Scratch memory: the rows of a bin that a chunk shows.
pub struct CodeRows(Box<[CodeRow; ROWS]>);

impl CodeRows {
    pub fn new() -> Self {
        Self(Box::new([CacheAligned([[0.0; ACROSS]; 3]); ROWS]))
    }
}

/// A chunk of a row of tiles that shows one bin.
pub struct Enlarge<'a> {
    pub bin: &'a Bin,
    pub slot: &'a Slot,
    /// First row and column in the picture.
    pub y0: usize,
    pub x0: usize,
    /// Columns of the chunk to write.
    pub columns: Range<usize>,
    /// Columns of the picture.
    pub width: usize,
    /// Highlight recovery.
    pub expansion: f32,
}

impl Enlarge<'_> {
    /// Writes 8-bit sRGB to the rows `out` of the picture.
    #[inline(always)]
    pub fn show<S: Simd>(&self, _: S, out: &mut [u8], codes: &mut CodeRows) {
        match self.bin.scale {
            2 => self.show_scale::<S, 2>(out, &mut codes.0),
            4 => self.show_scale::<S, 4>(out, &mut codes.0),
            _ => self.show_scale::<S, 8>(out, &mut codes.0),
        }
    }

    #[inline(always)]
    fn show_scale<S: Simd, const N: usize>(&self, out: &mut [u8], codes: &mut [CodeRow; ROWS]) {
        let last = self.bin.height - 1;
        let first_row = (self.y0 / N).saturating_sub(1);
        let rows = TILE_H / N + 2;
        for (k, codes) in codes[..rows].iter_mut().enumerate() {
            self.encode_row::<S, N>((first_row + k).min(last), codes);
        }
        for (dy, row) in out.chunks_exact_mut(self.width * 3).enumerate() {
            let along = ((self.y0 + dy) as f32 + 0.5) / N as f32 - 0.5;
            let along = along.clamp(0.0, last as f32);
            let (above, fraction) = (along as usize, along.fract());
            let below = (above + 1).min(last);
            let (above, below) = (&codes[above - first_row].0, &codes[below - first_row].0);
            let mut line = CacheAligned([[0u8; CHUNK]; 3]);
            for p in 0..3 {
                let mut between = [0.0f32; ACROSS];
                for x in 0..ACROSS {
                    between[x] = madd::<S>(below[p][x] - above[p][x], fraction, above[p][x]);
                }
                enlarge_columns::<S, N>(&between, &mut line.0[p]);
            }
            let [red, green, blue] = &line.0;
            let Range { start, end } = self.columns;
            let pixels = row[(self.x0 + start) * 3..(self.x0 + end) * 3].as_chunks_mut::<3>().0;
            for (((pixel, r), g), b) in pixels.iter_mut().zip(&red[start..]).zip(&green[start..]).zip(&blue[start..]) {
                *pixel = [*r, *g, *b];
            }
        }
    }

    /// Encodes a row of the bin, without its coverage.
    #[inline(always)]
    fn encode_row<S: Simd, const N: usize>(&self, y: usize, codes: &mut CodeRow) {
        let (first, width) = (self.x0 / N, self.bin.width);
        let mut planes = [[0.0f32; ACROSS]; 4];
        let count = (CHUNK / N + BEFORE).min(self.slot.source.across * STRIP - first);
        // The row lies in pieces, one in each strip.
        let row = |strip: usize| &self.slot.out[(strip * self.bin.height + y) * STRIP_ROW..][..STRIP_ROW];
        for x in (first.saturating_sub(BEFORE)..first + count).step_by(BEFORE) {
            let row = row(x / STRIP);
            for p in 0..4 {
                let to = &mut planes[p][x + BEFORE - first..][..BEFORE];
                to.copy_from_slice(&row[p * STRIP + x % STRIP..][..BEFORE]);
            }
        }
        // Beyond the picture its outermost pixels repeat.
        for plane in &mut planes {
            if first == 0 {
                plane[BEFORE - 1] = plane[BEFORE];
            }
            let end = (width - first + BEFORE).min(ACROSS);
            let last = plane[end - 1];
            plane[end..].fill(last);
        }
        let [red, green, blue, coverage] = &planes;
        for x in 0..ACROSS {
            let inverse = 1.0 / if coverage[x] > MIN_COVERAGE { coverage[x] } else { MIN_COVERAGE };
            let mut light = [red[x] * inverse, green[x] * inverse, blue[x] * inverse];
            if self.expansion.is_finite() {
                let factor = compression_factor(luminance(light[0], light[1], light[2]), self.expansion);
                light = light.map(|value| value * factor);
            }
            for p in 0..3 {
                codes.0[p][x] = codes_of::<S>(light[p]);
            }
        }
    }
}

/// Enlarges a row of codes `N` times and rounds it.
#[inline(always)]
fn enlarge_columns<S: Simd, const N: usize>(codes: &[f32; ACROSS], out: &mut [u8; CHUNK]) {
    let groups = out.as_chunks_mut::<N>().0;
    for k in 0..CHUNK / N {
        let (before, here, after) = (codes[BEFORE + k - 1], codes[BEFORE + k], codes[BEFORE + k + 1]);
        for i in 0..N {
            let offset = (i as f32 + 0.5) / N as f32 - 0.5;
            let code = if offset < 0.0 {
                madd::<S>(before - here, -offset, here)
            } else {
                madd::<S>(after - here, offset, here)
            };
            groups[k][i] = round_to_integer(code) as u8;
        }
    }
}
