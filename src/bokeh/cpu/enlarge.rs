//! Pass `composite` where one bin shows alone: it is encoded at its own scale, and the codes are enlarged, with linear
//! interpolation. What a blur lets through is so smooth that the interpolated codes are those of interpolated light.

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use std::ops::Range;

use pulp::Simd;

use super::encode::{code_of, interleave};
use super::rows::{COPY_WIDTH, STRIP, STRIP_ROW, Slot};
use super::tiles::{TILE_H, TILE_W};
use super::unpack::compression_factor;
use crate::bokeh::plan::{Bin, MIN_COVERAGE};
use crate::color::luminance;
use crate::compute::aligned::CacheAligned;
use crate::compute::simd::round_to_integer;

/// Columns of the picture that are enlarged at once.
const SPAN: usize = 16 * TILE_W;
/// Columns of a bin across a span at the finest reduced scale, and at least one more on both sides.
const ACROSS: usize = SPAN / 2 + 4 * COPY_WIDTH;
/// Rows of a bin that a row of tiles shows, at most.
const ROWS: usize = TILE_H / 2 + 2;
/// Steps of a code: an `i16` holds it, and its difference from another.
const STEPS: f32 = 128.0;

/// A row of a bin in a span, as codes: r, g, b.
type CodeRow = CacheAligned<[[i16; ACROSS]; 3]>;

/// Scratch memory: the rows of a bin that a span shows.
pub struct CodeRows(Box<[CodeRow; ROWS]>);

impl CodeRows {
    pub fn new() -> Self {
        Self(Box::new([CacheAligned([[0; ACROSS]; 3]); ROWS]))
    }
}

/// Adjacent tiles that show one bin.
pub struct Enlarge<'a> {
    pub bin: &'a Bin,
    pub slot: &'a Slot,
    /// First row in the picture.
    pub y0: usize,
    /// Columns of the picture: whole tiles.
    pub columns: Range<usize>,
    /// Columns of the whole picture.
    pub width: usize,
    /// Highlight recovery.
    pub expansion: f32,
}

impl Enlarge<'_> {
    /// Writes 8-bit sRGB to the rows `out` of the picture.
    #[inline(always)]
    pub fn show<S: Simd>(&self, _: S, out: &mut [u8], codes: &mut CodeRows) {
        for x0 in self.columns.clone().step_by(SPAN) {
            let columns = x0..(x0 + SPAN).min(self.columns.end);
            match self.bin.scale {
                2 => self.show_span::<S, 2>(columns, out, &mut codes.0),
                4 => self.show_span::<S, 4>(columns, out, &mut codes.0),
                _ => self.show_span::<S, 8>(columns, out, &mut codes.0),
            }
        }
    }

    #[inline(always)]
    fn show_span<S: Simd, const N: usize>(&self, columns: Range<usize>, out: &mut [u8], codes: &mut [CodeRow; ROWS]) {
        let (first, end) = (columns.start / N, columns.end.div_ceil(N));
        // The first column of the bin that is read, and its index in a row of codes.
        let (start, count) = (first.saturating_sub(1) / COPY_WIDTH * COPY_WIDTH, end + 1);
        let count = (count.min(self.bin.width) - start).next_multiple_of(COPY_WIDTH);
        for (k, codes) in codes[..TILE_H / N + 2].iter_mut().enumerate() {
            let y = (self.y0 / N + k).saturating_sub(1).min(self.bin.height - 1);
            self.encode_row::<S>(y, start, count, codes);
        }
        for (dy, row) in out.chunks_exact_mut(self.width * 3).enumerate() {
            let offset = offset_of::<N>(dy % N);
            let here = &codes[dy / N + 1].0;
            let other = &codes[if offset < 0 { dy / N } else { dy / N + 2 }].0;
            let mut between: CodeRow = CacheAligned([[0; ACROSS]; 3]);
            for p in 0..3 {
                for x in 0..ACROSS {
                    between.0[p][x] = towards(here[p][x], other[p][x], offset.abs());
                }
            }
            let mut line = CacheAligned([[0u8; SPAN]; 3]);
            for p in 0..3 {
                let codes = &between.0[p][COPY_WIDTH + first - start - 1..][..end - first + 2];
                enlarge_columns::<N>(codes, &mut line.0[p]);
            }
            interleave(line.0.each_ref().map(|plane| &plane[..]), &mut row[columns.start * 3..columns.end * 3]);
        }
    }

    /// Encodes `count` columns of a row of the bin, without its coverage. The first has index `COPY_WIDTH`.
    #[inline(always)]
    fn encode_row<S: Simd>(&self, y: usize, start: usize, count: usize, codes: &mut CodeRow) {
        for x in (start..start + count).step_by(COPY_WIDTH) {
            // A piece is inside one strip.
            let row = &self.slot.out[(x / STRIP * self.bin.height + y) * STRIP_ROW + x % STRIP..];
            let piece: [&[f32]; 4] = std::array::from_fn(|p| &row[p * STRIP..][..COPY_WIDTH]);
            let encoded = match self.expansion.is_finite() {
                true => encode_piece::<S, true>(piece, self.expansion),
                false => encode_piece::<S, false>(piece, self.expansion),
            };
            for p in 0..3 {
                codes.0[p][COPY_WIDTH + x - start..][..COPY_WIDTH].copy_from_slice(&encoded[p]);
            }
        }
        // Beyond the picture its outermost pixels repeat.
        let end = COPY_WIDTH + count.min(self.bin.width - start);
        for plane in &mut codes.0 {
            plane[COPY_WIDTH - 1] = plane[COPY_WIDTH];
            let last = plane[end - 1];
            plane[end..COPY_WIDTH + count + 1].fill(last);
        }
    }
}

/// Encodes premultiplied colour with its coverage, with highlights compressed if they are expanded.
#[inline(always)]
fn encode_piece<S: Simd, const EXPANDED: bool>(
    [red, green, blue, coverage]: [&[f32]; 4],
    expansion: f32,
) -> [[i16; COPY_WIDTH]; 3] {
    let mut codes = [[0; COPY_WIDTH]; 3];
    for x in 0..COPY_WIDTH {
        let inverse = 1.0 / if coverage[x] > MIN_COVERAGE { coverage[x] } else { MIN_COVERAGE };
        let mut light = [red[x] * inverse, green[x] * inverse, blue[x] * inverse];
        if EXPANDED {
            let factor = compression_factor(luminance(light[0], light[1], light[2]), expansion);
            light = light.map(|value| value * factor);
        }
        for p in 0..3 {
            codes[p][x] = round_to_integer(code_of::<S>(light[p]) * STEPS) as i16;
        }
    }
    codes
}

/// Returns how far pixel `k` of the `N` that enlarge one is from its centre, in pixels / 65536.
const fn offset_of<const N: usize>(k: usize) -> i16 {
    (((2 * k + 1) as i32 - N as i32) * (32768 / N as i32)) as i16
}

/// Returns what is between two values, `offset` / 65536 away from the first.
#[inline(always)]
fn towards(here: i16, other: i16, offset: i16) -> i16 {
    here + ((i32::from(other - here) * i32::from(offset)) >> 16) as i16
}

/// Enlarges codes `N` times along a row, given one more on both sides, and rounds them.
#[inline(always)]
fn enlarge_columns<const N: usize>(codes: &[i16], out: &mut [u8; SPAN]) {
    let count = codes.len() - 2;
    let (befores, heres, afters) = (&codes[..count], &codes[1..][..count], &codes[2..][..count]);
    for (((group, &before), &here), &after) in out.as_chunks_mut::<N>().0.iter_mut().zip(befores).zip(heres).zip(afters)
    {
        for i in 0..N {
            let offset = offset_of::<N>(i);
            let code = towards(here, if offset < 0 { before } else { after }, offset.abs());
            group[i] = ((code + STEPS as i16 / 2) >> 7) as u8;
        }
    }
}
