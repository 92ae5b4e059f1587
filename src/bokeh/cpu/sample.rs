//! Reads layers of a chunk in linear light: a blurred bin, enlarged to the scale of the picture, and what is in focus.
//!
//! twin: shaders/blur/composite.wgsl (`sample_bin`)

use std::ops::Range;

use pulp::Simd;

use super::encode::CHUNK;
use super::rows::{COPY_WIDTH, STRIP, STRIP_ROW, Slot};
use super::tent::VectorWeight;
use super::tiles::TILE_W;
use super::unpack::{InputFrame, Surfaces};
use crate::bokeh::plan::{Bin, BinWeight};
use crate::compute::aligned::CacheAligned;
use crate::compute::simd::{fma, load, madd, store};

/// Scratch memory: a row of a bin across a chunk at the finest reduced scale, and columns on both sides.
pub type SampledLines = CacheAligned<[[f32; CHUNK / 2 + 4 * COPY_WIDTH]; 4]>;

/// Reads some `columns` of a chunk of a bin, and the others of their tiles, at the picture's scale with linear
/// interpolation. Returns false if they are empty.
#[inline(always)]
pub fn sample_bin<S: Simd>(
    simd: S,
    bin: &Bin,
    slot: &Slot,
    (x0, y): (usize, usize),
    columns: Range<usize>,
    lines: &mut SampledLines,
    out: &mut [[f32; CHUNK]; 4],
) -> bool {
    if !slot.present {
        return false;
    }
    let along = ((y as f32 + 0.5) / bin.scale as f32 - 0.5).clamp(0.0, (bin.height - 1) as f32);
    let (above, fraction) = (along as usize, along.fract());
    let below = (above + 1).min(bin.height - 1);
    let wide = ((x0 + columns.start) / bin.scale).saturating_sub(1)..(x0 + columns.end) / bin.scale + 1;
    let has_content = |y: usize| slot.strips(wide.clone()).any(|strip| slot.is_active(strip, y, bin.height));
    if !has_content(above) && !has_content(below) {
        return false;
    }
    let (rows, tiles) =
        ((above, below, fraction), columns.start - columns.start % TILE_W..columns.end.next_multiple_of(TILE_W));
    match bin.scale {
        1 => upsample::<S, 1>(simd, (slot, bin.height), rows, x0, tiles, lines, out),
        2 => upsample::<S, 2>(simd, (slot, bin.height), rows, x0, tiles, lines, out),
        4 => upsample::<S, 4>(simd, (slot, bin.height), rows, x0, tiles, lines, out),
        _ => upsample::<S, 8>(simd, (slot, bin.height), rows, x0, tiles, lines, out),
    }
    true
}

/// Upsamples some tiles of the chunk at column `x0` from a bin of scale `N`: linear between rows `above` and `below`
/// (fraction `fraction`) and between columns.
#[inline(always)]
fn upsample<S: Simd, const N: usize>(
    simd: S,
    (slot, height): (&Slot, usize),
    (above, below, fraction): (usize, usize, f32),
    x0: usize,
    columns: Range<usize>,
    lines: &mut SampledLines,
    out: &mut [[f32; CHUNK]; 4],
) {
    let (width, fraction) = (slot.source.across * STRIP, simd.splat_f32s(fraction));
    let (first, end) = ((x0 + columns.start) / N, ((x0 + columns.end) / N).min(width));
    // A piece is inside one strip.
    let piece = |x: usize, y: usize, p: usize| {
        &slot.out[(x / STRIP * height + y) * STRIP_ROW + p * STRIP + x % STRIP..][..COPY_WIDTH]
    };
    if N == 1 {
        // Rows and columns of the bin are those of the picture.
        for (p, out) in out.iter_mut().enumerate() {
            for x in (first..end).step_by(COPY_WIDTH) {
                out[x - x0..][..COPY_WIDTH].copy_from_slice(piece(x, above, p));
            }
        }
        return;
    }
    // One column more on both sides than the tiles cover.
    let start = first.saturating_sub(1) / COPY_WIDTH * COPY_WIDTH;
    let count = (end + 1).min(width) - start;
    for (p, line) in lines.0.iter_mut().enumerate() {
        for x in (0..count).step_by(COPY_WIDTH) {
            let (a, b) = (piece(start + x, above, p), piece(start + x, below, p));
            for k in (0..COPY_WIDTH).step_by(S::F32_LANES) {
                let (a, b) = (load::<S>(a, k), load::<S>(b, k));
                store::<S>(line, COPY_WIDTH + x + k, fma(simd, simd.sub_f32s(b, a), fraction, a));
            }
        }
        // Beyond the picture its outermost pixels repeat.
        line[COPY_WIDTH - 1] = line[COPY_WIDTH];
        if start + count == width {
            line[COPY_WIDTH + count] = line[COPY_WIDTH + count - 1];
        }
    }
    for (line, out) in lines.0.iter().zip(out) {
        let line = &line[COPY_WIDTH + first - start - 1..];
        let groups = out[columns.clone()].as_chunks_mut::<N>().0;
        let neighbours = line.iter().zip(&line[1..]).zip(&line[2..]);
        for (group, ((&before, &here), &after)) in groups.iter_mut().zip(neighbours) {
            for (i, value) in group.iter_mut().enumerate() {
                let offset = (i as f32 + 0.5) / N as f32 - 0.5;
                *value = madd::<S>(if offset < 0.0 { before } else { after } - here, offset.abs(), here);
            }
        }
    }
}

/// Reads what is in focus in the first columns of a chunk from the picture, as a layer.
#[inline(always)]
pub fn read_in_focus<S: Simd>(
    simd: S,
    frame: &InputFrame<'_>,
    weight: &BinWeight,
    (x0, y): (usize, usize),
    columns: usize,
    surfaces: &mut Surfaces<CHUNK>,
    out: &mut [[f32; CHUNK]; 4],
) {
    frame.unpack::<S, CHUNK>(y, x0 as isize, columns, surfaces);
    let weight = VectorWeight::new(simd, &Some(*weight));
    for x in (0..columns).step_by(S::F32_LANES) {
        let taken = weight.surface_weights(simd, surfaces, x);
        let values = weight.apply(simd, taken, surfaces, x);
        for p in 0..4 {
            store::<S>(&mut out[p], x, values[p]);
        }
    }
}
