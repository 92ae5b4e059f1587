//! Pass `composite`: the blurred bins, front to back, become one picture; back to 8-bit sRGB.
//!
//! The pixels of one view tile the picture, so the coverages of two bins are disjoint, not independent: a bin fills
//! what is left, and what stays open at the end is filled in proportion.

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use pulp::{Simd, WithSimd};

use super::rows::{STRIP, Slot};
use super::simd::madd;
use super::tiles::{TILE_H, TILE_W, Tiles};
use super::unpack::{Source, coc_row, compress, linear_to_srgb, luminance};
use crate::bokeh::plan::{Bin, CELL, Compositing, HINDMOST_COVERAGE, Plan};

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

/// Rows `y0..` of the result, a row of tiles.
pub struct Composite<'a> {
    /// The plan.
    pub plan: &'a Plan,
    /// The blurred bins.
    pub slots: &'a [Slot],
    /// What stays as it is.
    pub tiles: &'a Tiles,
    /// The frame as it came.
    pub frame: &'a Source<'a>,
    /// `[row][3][width]`, from the gather.
    pub gathered: &'a [f32],
    /// From [`encode_table`].
    pub encode: &'a [u8],
    /// First row.
    pub y0: usize,
    /// Whole rows of RGB.
    pub out: &'a mut [u8],
}

/// What the chunk has so far.
#[repr(align(64))]
struct Stack {
    color: [[f32; CHUNK]; 3],
    /// How much of each pixel nothing has covered yet.
    open: [f32; CHUNK],
    /// The colour of the hindmost bin that counts here, and how far that is known.
    hindmost: [[f32; CHUNK]; 3],
    known: [f32; CHUNK],
}

impl Stack {
    const EMPTY: Self =
        Self { color: [[0.0; CHUNK]; 3], open: [1.0; CHUNK], hindmost: [[0.0; CHUNK]; 3], known: [0.0; CHUNK] };

    /// Puts a bin behind all there is: it covers what is still open.
    #[inline(always)]
    fn add<S: Simd>(&mut self, layer: &[[f32; CHUNK]; 4]) {
        for x in 0..CHUNK {
            let coverage = layer[3][x];
            let taken = if coverage < self.open[x] { coverage } else { self.open[x] };
            let inverse = 1.0 / if coverage > 1e-6 { coverage } else { 1e-6 };
            let counts = coverage * (1.0 / HINDMOST_COVERAGE);
            let counts = if counts < 1.0 { counts } else { 1.0 };
            for p in 0..3 {
                let own = layer[p][x] * inverse;
                self.color[p][x] = madd::<S>(own, taken, self.color[p][x]);
                self.hindmost[p][x] = madd::<S>(own - self.hindmost[p][x], counts, self.hindmost[p][x]);
            }
            self.known[x] = madd::<S>(1.0 - self.known[x], counts, self.known[x]);
            self.open[x] -= taken;
        }
    }

    /// What is still open was hidden from the camera, and lies behind all else: it gets the colour of the hindmost.
    #[inline(always)]
    fn close<S: Simd>(&mut self) {
        for x in 0..CHUNK {
            let known = self.known[x];
            let scale = self.open[x] / if known > 1e-6 { known } else { 1e-6 };
            for p in 0..3 {
                self.color[p][x] = madd::<S>(self.hindmost[p][x], scale, self.color[p][x]);
            }
        }
    }
}

impl WithSimd for Composite<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        let width = self.plan.width;
        let row_of_tiles = self.y0 / TILE_H * self.tiles.across;
        let out = std::mem::take(&mut self.out);
        for x0 in (0..width).step_by(CHUNK) {
            let take = CHUNK.min(width - x0);
            let tiles = row_of_tiles + x0 / TILE_W..row_of_tiles + (x0 + take).div_ceil(TILE_W);
            let still = self.tiles.still[tiles].iter().all(|&still| still);
            for (dy, row) in out.chunks_exact_mut(width * 3).enumerate() {
                let y = self.y0 + dy;
                let row = &mut row[x0 * 3..][..take * 3];
                let color = match self.plan.compositing {
                    Compositing::Layers => match self.layers::<S>(y, x0, still) {
                        Some(color) => color,
                        None => {
                            row.copy_from_slice(&self.frame.color.rgb[(y * width + x0) * 3..][..take * 3]);
                            continue;
                        }
                    },
                    Compositing::Select => self.select::<S>(y, x0, take),
                    Compositing::Gather => gathered(self.gathered, width, y, x0),
                };
                encode(color, self.plan.expansion, self.encode, row);
            }
        }
    }
}

impl Composite<'_> {
    /// Disjoint coverage, near bins first; none where a still chunk stays as it is.
    #[inline(always)]
    fn layers<S: Simd>(&self, y: usize, x0: usize, still: bool) -> Option<[[f32; CHUNK]; 3]> {
        let mut layer = [[0.0; CHUNK]; 4];
        let mut back = Stack::EMPTY;
        let near = self.plan.bins.iter().take_while(|bin| bin.near).count();
        let (near, rest) = self.plan.bins.split_at(near);
        let mut front: Option<Stack> = None;
        for bin in near {
            if sample::<S>(bin, &self.slots[bin.slot], y, x0, &mut layer) {
                front.get_or_insert(Stack::EMPTY).add::<S>(&layer);
            }
        }
        if front.is_none() && still {
            return None;
        }
        let mut some = false;
        for bin in rest {
            if sample::<S>(bin, &self.slots[bin.slot], y, x0, &mut layer) {
                back.add::<S>(&layer);
                some = true;
            }
        }
        let Some(mut front) = front else {
            back.close::<S>();
            return Some(back.color);
        };
        if !some {
            // Where nothing lies behind, what lies in front is all there is.
            front.close::<S>();
            return Some(front.color);
        }
        for x in 0..CHUNK {
            // A pixel that nothing behind reaches keeps what lies in front alone.
            let filled = back.known[x] > 1e-4;
            let scale = back.open[x] / if filled { back.known[x] } else { 1.0 };
            let (behind, ahead) =
                if filled { (front.open[x], 1.0) } else { (0.0, 1.0 / (1.0 - front.open[x]).max(1e-4)) };
            for p in 0..3 {
                let hidden = madd::<S>(back.hindmost[p][x], scale, back.color[p][x]);
                front.color[p][x] = madd::<S>(hidden, behind, front.color[p][x] * ahead);
            }
        }
        Some(front.color)
    }

    /// Every pixel takes the bins of its own CoC.
    #[inline(always)]
    fn select<S: Simd>(&self, y: usize, x0: usize, take: usize) -> [[f32; CHUNK]; 3] {
        let mut color = [[0.0; CHUNK]; 3];
        let mut layer = [[0.0; CHUNK]; 4];
        let mut coc = [0.0; CHUNK];
        coc_row(self.frame, y, x0, &mut coc[..take]);
        for (k, bin) in self.plan.bins.iter().enumerate() {
            if !sample::<S>(bin, &self.slots[bin.slot], y, x0, &mut layer) {
                continue;
            }
            let share = self.plan.share(k);
            for x in 0..CHUNK {
                let weight = share.at(coc[x]) / if layer[3][x] > 1e-6 { layer[3][x] } else { 1e-6 };
                for p in 0..3 {
                    color[p][x] = madd::<S>(layer[p][x], weight, color[p][x]);
                }
            }
        }
        color
    }
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
fn sample<S: Simd>(bin: &Bin, slot: &Slot, y: usize, x0: usize, out: &mut [[f32; CHUNK]; 4]) -> bool {
    if !slot.present {
        return false;
    }
    let along = ((y as f32 + 0.5) / bin.scale as f32 - 0.5).clamp(0.0, (bin.height - 1) as f32);
    let (above, share) = (along as usize, along.fract());
    let below = (above + 1).min(bin.height - 1);
    let columns = (x0 / bin.scale).saturating_sub(1)..(x0 + CHUNK) / bin.scale + 1;
    let holds = |y: usize| {
        let strips = columns.start / STRIP..columns.end.div_ceil(STRIP).min(slot.strips);
        let down = bin.height.div_ceil(CELL);
        strips.into_iter().any(|strip| slot.active[strip * down + y / CELL])
    };
    if !holds(above) && !holds(below) {
        return false;
    }
    match bin.scale {
        1 => stretch::<S, 1>(slot, bin.height, (above, below, share), x0, out),
        2 => stretch::<S, 2>(slot, bin.height, (above, below, share), x0, out),
        4 => stretch::<S, 4>(slot, bin.height, (above, below, share), x0, out),
        _ => stretch::<S, 8>(slot, bin.height, (above, below, share), x0, out),
    }
    true
}

#[inline(always)]
fn stretch<V: Simd, const S: usize>(
    slot: &Slot,
    height: usize,
    (above, below, share): (usize, usize, f32),
    x0: usize,
    out: &mut [[f32; CHUNK]; 4],
) {
    let width = slot.strips * STRIP;
    let strip_row = |strip: usize, y: usize, p: usize| &slot.out[((strip * height + y) * 4 + p) * STRIP..][..STRIP];
    let mix = |a: f32, b: f32| madd::<V>(b - a, share, a);
    for (p, out) in out.iter_mut().enumerate() {
        let value =
            |x: usize| mix(strip_row(x / STRIP, above, p)[x % STRIP], strip_row(x / STRIP, below, p)[x % STRIP]);
        let first = x0 / S;
        // One column more on both sides than the chunk covers.
        let mut line = [0.0; CHUNK + 2];
        let mut x = first;
        while x < (first + CHUNK / S).min(width) {
            let count = (STRIP - x % STRIP).min(first + CHUNK / S - x);
            let (a, b) = (strip_row(x / STRIP, above, p), strip_row(x / STRIP, below, p));
            let (a, b) = (&a[x % STRIP..][..count], &b[x % STRIP..][..count]);
            for ((out, &a), &b) in line[1 + x - first..][..count].iter_mut().zip(a).zip(b) {
                *out = mix(a, b);
            }
            x += count;
        }
        if S == 1 {
            out.copy_from_slice(&line[1..1 + CHUNK]);
            continue;
        }
        line[0] = if first > 0 { value(first - 1) } else { line[1] };
        line[1 + x - first] = if x < width { value(x) } else { line[x - first] };
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
