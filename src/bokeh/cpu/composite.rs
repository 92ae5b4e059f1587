//! Pass `composite`: the blurred bins, front to back, become one picture; back to 8-bit sRGB.
//!
//! The pixels of one view tile the picture, so the coverages of two bins are disjoint, not independent: a bin fills
//! what is left, and what stays open at the end is filled in proportion.

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use pulp::{Simd, WithSimd};

use super::rows::{BinRows, Rows, STRIP};
use super::simd::madd;
use super::unpack::{compress, linear_to_srgb, luminance};
use crate::bokeh::plan::{CELL, Compositing, Plan, Share};

/// Pixels composited at once.
pub const CHUNK: usize = 128;
/// Entries of one half of the table back to 8 bits: small enough for the nearest cache, fine enough that decoding and
/// encoding is the identity.
const ENCODE_STEPS: usize = 1 << 12;
/// Light below this has a half of its own, as steep as the curve is there.
const DARK: f32 = 1.0 / 16.0;

/// The table from linear light to 8-bit sRGB: light up to [`DARK`] in `ENCODE_STEPS` steps, then all of it.
pub fn encode_table() -> Vec<u8> {
    let half = |most: f32| (0..=ENCODE_STEPS).map(move |k| k as f32 / ENCODE_STEPS as f32 * most);
    half(DARK).chain(half(1.0)).map(|light| (linear_to_srgb(light) * 255.0 + 0.5) as u8).collect()
}

/// Rows `y0..` of the result.
pub struct Composite<'a> {
    /// The plan.
    pub plan: &'a Plan,
    /// The blurred bins.
    pub bins: &'a [BinRows],
    /// Each bin's share of a CoC.
    pub shares: &'a [Share],
    /// The picture from `unpack`.
    pub scene: &'a Rows<4>,
    /// `[row][3][width]`, from the gather.
    pub gathered: &'a [f32],
    /// From [`encode_table`].
    pub encode: &'a [u8],
    /// First row.
    pub y0: usize,
    /// Whole rows of RGB.
    pub out: &'a mut [u8],
}

/// What the chunk has so far: colour and what is still open.
#[repr(align(64))]
struct Stack {
    color: [[f32; CHUNK]; 3],
    open: [f32; CHUNK],
}

impl Stack {
    const EMPTY: Self = Self { color: [[0.0; CHUNK]; 3], open: [1.0; CHUNK] };
}

impl WithSimd for Composite<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let width = self.plan.width;
        for (dy, row) in self.out.chunks_exact_mut(width * 3).enumerate() {
            for x0 in (0..width).step_by(CHUNK) {
                let take = CHUNK.min(width - x0);
                let y = self.y0 + dy;
                let color = match self.plan.compositing {
                    Compositing::Layers => layers::<S>(self.plan, self.bins, y, x0),
                    Compositing::Select => select::<S>(self.plan, self.bins, self.shares, self.scene, y, x0),
                    Compositing::Gather => gathered(self.gathered, width, y, x0),
                };
                encode(color, self.plan.expansion, self.encode, &mut row[x0 * 3..][..take * 3]);
            }
        }
    }
}

/// Disjoint coverage, near bins first; what is behind them is normalised on its own.
#[inline(always)]
fn layers<S: Simd>(plan: &Plan, bins: &[BinRows], y: usize, x0: usize) -> [[f32; CHUNK]; 3] {
    let any_near = plan.bins.iter().zip(bins).any(|(bin, rows)| bin.near && rows.present);
    let mut front = Stack::EMPTY;
    let mut back = Stack::EMPTY;
    let mut layer = [[0.0; CHUNK]; 4];
    for (bin, rows) in plan.bins.iter().zip(bins) {
        if !sample::<S>(bin.scale, bin.height, rows, y, x0, &mut layer) {
            continue;
        }
        let stack = if bin.near { &mut front } else { &mut back };
        for x in 0..CHUNK {
            let coverage = layer[3][x];
            let taken = if coverage < stack.open[x] { coverage } else { stack.open[x] };
            let share = taken / if coverage > 1e-6 { coverage } else { 1e-6 };
            for p in 0..3 {
                stack.color[p][x] = madd::<S>(layer[p][x], share, stack.color[p][x]);
            }
            stack.open[x] -= taken;
        }
    }
    if !any_near {
        for x in 0..CHUNK {
            let filled = 1.0 - back.open[x];
            let scale = 1.0 / if filled > 1e-4 { filled } else { 1e-4 };
            for p in 0..3 {
                back.color[p][x] *= scale;
            }
        }
        return back.color;
    }
    for x in 0..CHUNK {
        let filled = 1.0 - back.open[x];
        // Where nothing lies behind, what lies in front is all there is.
        let behind = if filled > 1e-4 { front.open[x] / filled } else { 0.0 };
        let ahead = if filled > 1e-4 { 1.0 } else { 1.0 / (1.0 - front.open[x]).max(1e-4) };
        for p in 0..3 {
            front.color[p][x] = front.color[p][x] * ahead + back.color[p][x] * behind;
        }
    }
    front.color
}

/// Every pixel takes the bins of its own CoC.
#[inline(always)]
fn select<S: Simd>(
    plan: &Plan,
    bins: &[BinRows],
    shares: &[Share],
    scene: &Rows<4>,
    y: usize,
    x0: usize,
) -> [[f32; CHUNK]; 3] {
    let mut color = [[0.0; CHUNK]; 3];
    let mut layer = [[0.0; CHUNK]; 4];
    let coc = &scene.plane(y, 3)[x0..];
    let take = CHUNK.min(coc.len());
    for ((bin, rows), share) in plan.bins.iter().zip(bins).zip(shares) {
        if !sample::<S>(bin.scale, bin.height, rows, y, x0, &mut layer) {
            continue;
        }
        for x in 0..take {
            let weight = share.at(coc[x]) / if layer[3][x] > 1e-6 { layer[3][x] } else { 1e-6 };
            for p in 0..3 {
                color[p][x] = madd::<S>(layer[p][x], weight, color[p][x]);
            }
        }
    }
    color
}

#[inline(always)]
fn gathered(rows: &[f32], width: usize, y: usize, x0: usize) -> [[f32; CHUNK]; 3] {
    let mut color = [[0.0; CHUNK]; 3];
    let take = CHUNK.min(width - x0);
    for (p, color) in color.iter_mut().enumerate() {
        color[..take].copy_from_slice(&rows[(y * 3 + p) * width + x0..][..take]);
    }
    color
}

/// Reads a chunk of a bin at the picture's scale (linear interpolation); false when there is nothing in it.
#[inline(always)]
fn sample<S: Simd>(
    scale: usize,
    height: usize,
    rows: &BinRows,
    y: usize,
    x0: usize,
    out: &mut [[f32; CHUNK]; 4],
) -> bool {
    if !rows.present {
        return false;
    }
    let along = ((y as f32 + 0.5) / scale as f32 - 0.5).clamp(0.0, (height - 1) as f32);
    let (above, share) = (along as usize, along.fract());
    let below = (above + 1).min(height - 1);
    let (first, count) = (x0 / scale / STRIP, CHUNK / scale / STRIP);
    let holds = |y: usize| {
        let strips = first.saturating_sub(1)..(first + count + 1).min(rows.strips);
        let down = height.div_ceil(CELL);
        strips.into_iter().any(|strip| rows.active[strip * down + y / CELL])
    };
    if !holds(above) && !holds(below) {
        return false;
    }
    match scale {
        1 => stretch::<S, 1>(rows, height, (above, below, share), first, count, out),
        2 => stretch::<S, 2>(rows, height, (above, below, share), first, count, out),
        _ => stretch::<S, 4>(rows, height, (above, below, share), first, count, out),
    }
    true
}

#[inline(always)]
fn stretch<V: Simd, const S: usize>(
    rows: &BinRows,
    height: usize,
    (above, below, share): (usize, usize, f32),
    first: usize,
    count: usize,
    out: &mut [[f32; CHUNK]; 4],
) {
    let strip_row = |strip: usize, y: usize, p: usize| {
        let strip = strip.min(rows.strips - 1);
        &rows.out[((strip * height + y) * 4 + p) * STRIP..][..STRIP]
    };
    for (p, out) in out.iter_mut().enumerate() {
        if S == 1 {
            for (k, out) in out.as_chunks_mut::<STRIP>().0.iter_mut().enumerate() {
                out.copy_from_slice(strip_row(first + k, above, p));
            }
            continue;
        }
        // One column more on both sides than the chunk covers.
        let mut line = [0.0; CHUNK + 2];
        let mix = |a: f32, b: f32| madd::<V>(b - a, share, a);
        for k in 0..count {
            let (a, b) = (strip_row(first + k, above, p), strip_row(first + k, below, p));
            let line = &mut line[1 + k * STRIP..][..STRIP];
            for i in 0..STRIP {
                line[i] = mix(a[i], b[i]);
            }
        }
        let (left, at) = if first > 0 { (first - 1, STRIP - 1) } else { (0, 0) };
        line[0] = mix(strip_row(left, above, p)[at], strip_row(left, below, p)[at]);
        let (right, at) = if first + count < rows.strips { (first + count, 0) } else { (rows.strips - 1, STRIP - 1) };
        line[CHUNK / S + 1] = mix(strip_row(right, above, p)[at], strip_row(right, below, p)[at]);
        for (k, group) in out.as_chunks_mut::<S>().0.iter_mut().enumerate() {
            let (before, here, after) = (line[k], line[k + 1], line[k + 2]);
            for (i, out) in group.iter_mut().enumerate() {
                let offset = (i as f32 + 0.5) / S as f32 - 0.5;
                *out = if offset < 0.0 {
                    madd::<V>(before - here, -offset, here)
                } else {
                    madd::<V>(after - here, offset, here)
                };
            }
        }
    }
}

#[inline(always)]
fn encode(mut color: [[f32; CHUNK]; 3], expansion: f32, table: &[u8], out: &mut [u8]) {
    if expansion.is_finite() {
        for x in 0..CHUNK {
            let factor = compress(luminance(color[0][x], color[1][x], color[2][x]), expansion);
            for p in 0..3 {
                color[p][x] *= factor;
            }
        }
    }
    let mut index = [[0u16; CHUNK]; 3];
    for (index, color) in index.iter_mut().zip(&color) {
        for (index, &light) in index.iter_mut().zip(color) {
            let light = light.clamp(0.0, 1.0);
            let (scale, first) = if light < DARK { (1.0 / DARK, 0.5) } else { (1.0, ENCODE_STEPS as f32 + 1.5) };
            *index = (light * (scale * ENCODE_STEPS as f32) + first) as u16;
        }
    }
    for (x, pixel) in out.chunks_exact_mut(3).enumerate() {
        for (p, byte) in pixel.iter_mut().enumerate() {
            *byte = table[index[p][x] as usize];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::unpack::decode_table;
    use super::*;

    #[test]
    fn decoding_and_encoding_is_the_identity() {
        let (decode, encode_to) = (decode_table(), encode_table());
        for code in 0..=255u8 {
            let mut out = [0u8; 6];
            encode([[decode[code as usize]; CHUNK]; 3], f32::INFINITY, &encode_to, &mut out);
            assert_eq!(out, [code; 6]);
        }
    }
}
