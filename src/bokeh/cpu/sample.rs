//! Enlarges a chunk of a blurred bin to the scale of the picture, in linear light.
//!
//! twin: shaders/blur/composite.wgsl (`sample_bin`)

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use pulp::Simd;

use super::encode::CHUNK;
use super::rows::{COPY_WIDTH, STRIP, Slot};
use crate::bokeh::plan::Bin;
use crate::compute::aligned::CacheAligned;
use crate::compute::simd::{fma, load, madd, store};

/// Reads a chunk of a bin at the picture's scale with linear interpolation. Returns false if it is empty.
#[inline(always)]
pub fn sample_bin<S: Simd>(simd: S, bin: &Bin, slot: &Slot, y: usize, x0: usize, out: &mut [[f32; CHUNK]; 4]) -> bool {
    if !slot.present {
        return false;
    }
    let along = ((y as f32 + 0.5) / bin.scale as f32 - 0.5).clamp(0.0, (bin.height - 1) as f32);
    let (above, fraction) = (along as usize, along.fract());
    let below = (above + 1).min(bin.height - 1);
    let columns = (x0 / bin.scale).saturating_sub(1)..(x0 + CHUNK) / bin.scale + 1;
    let has_content = |y: usize| slot.strips(columns.clone()).any(|strip| slot.is_active(strip, y, bin.height));
    if !has_content(above) && !has_content(below) {
        return false;
    }
    match bin.scale {
        1 => upsample::<S, 1>(simd, slot, bin.height, (above, below, fraction), x0, out),
        2 => upsample::<S, 2>(simd, slot, bin.height, (above, below, fraction), x0, out),
        4 => upsample::<S, 4>(simd, slot, bin.height, (above, below, fraction), x0, out),
        _ => upsample::<S, 8>(simd, slot, bin.height, (above, below, fraction), x0, out),
    }
    true
}

/// Upsamples a chunk of a bin of scale `S`: linear between rows `above` and `below` (fraction `fraction`) and between
/// columns.
#[inline(always)]
fn upsample<V: Simd, const S: usize>(
    simd: V,
    slot: &Slot,
    height: usize,
    (above, below, fraction): (usize, usize, f32),
    x0: usize,
    out: &mut [[f32; CHUNK]; 4],
) {
    let width = slot.source.across * STRIP;
    let fraction = simd.splat_f32s(fraction);
    let (first, end) = (x0 / S, ((x0 + CHUNK) / S).min(width));
    // A piece is inside one strip.
    let piece = |x: usize, y: usize, p: usize| {
        &slot.out[((x / STRIP * height + y) * 4 + p) * STRIP + x % STRIP..][..COPY_WIDTH]
    };
    if S == 1 {
        // Rows and columns of the bin are those of the picture.
        for (p, out) in out.iter_mut().enumerate() {
            for x in (first..end).step_by(COPY_WIDTH) {
                out[x - first..][..COPY_WIDTH].copy_from_slice(piece(x, above, p));
            }
        }
        return;
    }
    // One column more on both sides than the chunk covers.
    let mut lines = CacheAligned([[0.0; CHUNK + 2 * COPY_WIDTH]; 4]);
    for (p, line) in lines.0.iter_mut().enumerate() {
        for x in (first.saturating_sub(COPY_WIDTH)..(end + COPY_WIDTH).min(width)).step_by(COPY_WIDTH) {
            let (a, b) = (piece(x, above, p), piece(x, below, p));
            let line = &mut line[COPY_WIDTH + x - first..][..COPY_WIDTH];
            for k in (0..COPY_WIDTH).step_by(V::F32_LANES) {
                let (a, b) = (load::<V>(a, k), load::<V>(b, k));
                store::<V>(line, k, fma(simd, simd.sub_f32s(b, a), fraction, a));
            }
        }
        if first == 0 {
            line[COPY_WIDTH - 1] = line[COPY_WIDTH];
        }
        if end == width {
            line[COPY_WIDTH + end - first] = line[COPY_WIDTH + end - first - 1];
        }
    }
    for (line, out) in lines.0.iter().zip(out) {
        let (befores, line) = (&line[COPY_WIDTH - 1..], &line[COPY_WIDTH..]);
        let (befores, heres, afters) = (&befores[..CHUNK / S], &line[..CHUNK / S], &line[1..][..CHUNK / S]);
        let groups = &mut out.as_chunks_mut::<S>().0[..CHUNK / S];
        for k in 0..CHUNK / S {
            let (before, here, after) = (befores[k], heres[k], afters[k]);
            for i in 0..S {
                let offset = (i as f32 + 0.5) / S as f32 - 0.5;
                groups[k][i] = if offset < 0.0 {
                    madd::<V>(before - here, -offset, here)
                } else {
                    madd::<V>(after - here, offset, here)
                };
            }
        }
    }
}
