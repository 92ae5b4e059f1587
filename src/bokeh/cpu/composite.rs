//! Pass `composite`: the blurred bins, front to back, become one picture; back to its pixels' kind.
//!
//! The pixels of one view tile the picture, so the coverages of two bins are disjoint, not independent: among the near
//! bins, and among the others, a bin fills what is left. The near ones lie over the others; what stays open takes the
//! colour of the hindmost.

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use pulp::{Simd, WithSimd};

use super::encode::{CHUNK, EncodeTable};
use super::pixels::Sample;
use super::rows::{STRIP, Slot};
use super::tiles::{TILE_H, TILE_W, Tiles};
use super::unpack::{Source, coc_row, compress};
use crate::bokeh::ladder::Compositing;
use crate::bokeh::plan::{Bin, CELL, HINDMOST_COVERAGE, MAX_BINS, Plan};
use crate::color::luminance;
use crate::compute::aligned::Line;
use crate::compute::simd::{fma, load, madd, store};

/// Makes rows `y0..` of the result: a row of tiles.
pub struct Composite<'a, T> {
    pub plan: &'a Plan,
    pub slots: &'a [Slot],
    /// Tells which tiles stay as they are.
    pub tiles: &'a Tiles,
    /// The frame as it came, and its pixels.
    pub frame: &'a Source<'a>,
    pub pixels: &'a [T],
    /// `[row][3][width]`, from the gather.
    pub gathered: &'a [f32],
    /// Back to 8 bits.
    pub encode: &'a EncodeTable,
    pub y0: usize,
    /// Whole rows of RGB.
    pub out: &'a mut [T],
}

/// Bins composited front to back at some pixels: each covers what is still open.
#[derive(Clone, Copy)]
struct Pile<S: Simd> {
    color: [S::f32s; 3],
    /// How much of each pixel nothing has covered yet.
    open: S::f32s,
    /// The colour of the hindmost bin that counts here, and how far that is known.
    hindmost: [S::f32s; 3],
    known: S::f32s,
}

impl<S: Simd> Pile<S> {
    #[inline(always)]
    fn new(simd: S) -> Self {
        let [zero, one] = [0.0, 1.0].map(|value| simd.splat_f32s(value));
        Self { color: [zero; 3], open: one, hindmost: [zero; 3], known: zero }
    }

    /// Adds a bin behind all others, as premultiplied colour and coverage.
    #[inline(always)]
    fn add(&mut self, simd: S, layer: [S::f32s; 4]) {
        let one = simd.splat_f32s(1.0);
        let covered = simd.min_f32s(layer[3], self.open);
        let inverse = simd.div_f32s(one, simd.max_f32s(layer[3], simd.splat_f32s(1e-6)));
        let weight = simd.min_f32s(simd.mul_f32s(layer[3], simd.splat_f32s(1.0 / HINDMOST_COVERAGE)), one);
        for p in 0..3 {
            let straight = simd.mul_f32s(layer[p], inverse);
            self.color[p] = fma(simd, straight, covered, self.color[p]);
            self.hindmost[p] = fma(simd, simd.sub_f32s(straight, self.hindmost[p]), weight, self.hindmost[p]);
        }
        self.known = fma(simd, simd.sub_f32s(one, self.known), weight, self.known);
        self.open = simd.sub_f32s(self.open, covered);
    }

    /// The colour, with what is still open in that of the hindmost bin: it was hidden from the camera behind all else.
    #[inline(always)]
    fn with_rest_filled(&self, simd: S) -> [S::f32s; 3] {
        let scale = simd.div_f32s(self.open, simd.max_f32s(self.known, simd.splat_f32s(1e-6)));
        std::array::from_fn(|p| fma(simd, self.hindmost[p], scale, self.color[p]))
    }
}

/// The layers of a chunk, front to back.
struct Layers {
    planes: Line<[[[f32; CHUNK]; 4]; MAX_BINS]>,
    near: usize,
    count: usize,
}

impl Layers {
    /// Composites the layers, the near ones over the others, to linear light.
    #[inline(always)]
    fn flatten<S: Simd>(&self, simd: S, color: &mut Color) {
        let (near, rest) = self.planes.0[..self.count].split_at(self.near);
        let zero = simd.splat_f32s(0.0);
        for x in (0..CHUNK).step_by(S::F32_LANES) {
            let layer = |planes: &[[f32; CHUNK]; 4]| planes.each_ref().map(|plane| load::<S>(plane, x));
            let mut back = Pile::new(simd);
            rest.iter().for_each(|planes| back.add(simd, layer(planes)));
            let mut light = back.with_rest_filled(simd);
            if !near.is_empty() {
                let mut front = Pile::new(simd);
                near.iter().for_each(|planes| front.add(simd, layer(planes)));
                // Where nothing lies behind, the near bins have to fill the pixel.
                let has_back = simd.greater_than_f32s(back.known, simd.splat_f32s(1e-4));
                let alone = front.with_rest_filled(simd);
                let open = simd.select_f32s(has_back, front.open, zero);
                for p in 0..3 {
                    let ahead = simd.select_f32s(has_back, front.color[p], alone[p]);
                    light[p] = fma(simd, light[p], open, ahead);
                }
            }
            for p in 0..3 {
                let light = simd.max_f32s(light[p], zero);
                store::<S>(&mut color.0[p], x, light);
            }
        }
    }
}

/// Linear light of a chunk.
type Color = Line<[[f32; CHUNK]; 3]>;

impl<T: Sample> WithSimd for Composite<'_, T> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let width = self.plan.width;
        let row_of_tiles = self.y0 / TILE_H * self.tiles.across;
        let out = std::mem::take(&mut self.out);
        let mut layers = Layers { planes: Line([[[0.0; CHUNK]; 4]; MAX_BINS]), near: 0, count: 0 };
        let mut color = Line([[0.0; CHUNK]; 3]);
        for x0 in (0..width).step_by(CHUNK) {
            let take = CHUNK.min(width - x0);
            let tiles = row_of_tiles + x0 / TILE_W..row_of_tiles + (x0 + take).div_ceil(TILE_W);
            let still = self.tiles.still[tiles].iter().all(|&still| still);
            for (dy, row) in out.chunks_exact_mut(width * 3).enumerate() {
                let y = self.y0 + dy;
                let row = &mut row[x0 * 3..][..take * 3];
                match self.plan.compositing {
                    Compositing::Layers => {
                        if !self.read_layers::<S>(y, x0, still, &mut layers) {
                            row.copy_from_slice(&self.pixels[(y * width + x0) * 3..][..take * 3]);
                            continue;
                        }
                        layers.flatten(simd, &mut color);
                    }
                    Compositing::Select => self.select::<S>(y, x0, take, &mut layers.planes.0[0], &mut color.0),
                    Compositing::Gather => copy_gathered(self.gathered, width, y, x0, &mut color.0),
                }
                compress_highlights(&mut color.0, self.frame.expansion);
                T::write(&color.0, self.encode, row);
            }
        }
    }
}

impl<T> Composite<'_, T> {
    /// Reads the bins that hold anything in a chunk; false where it is `still` and nothing near reaches it: it stays.
    #[inline(always)]
    fn read_layers<S: Simd>(&self, y: usize, x0: usize, still: bool, layers: &mut Layers) -> bool {
        (layers.near, layers.count) = (0, 0);
        for bin in &self.plan.bins {
            if still && !bin.near && layers.count == 0 {
                return false;
            }
            if sample::<S>(bin, &self.slots[bin.slot], y, x0, &mut layers.planes.0[layers.count]) {
                layers.count += 1;
                layers.near += usize::from(bin.near);
            }
        }
        true
    }

    /// The colour of a chunk of `take` pixels, from the bins of each pixel's own CoC, by their share of it.
    #[inline(always)]
    fn select<S: Simd>(
        &self,
        y: usize,
        x0: usize,
        take: usize,
        layer: &mut [[f32; CHUNK]; 4],
        color: &mut [[f32; CHUNK]; 3],
    ) {
        let mut coc = [0.0; CHUNK];
        coc_row(self.frame, y, x0, &mut coc[..take]);
        *color = [[0.0; CHUNK]; 3];
        for (k, bin) in self.plan.bins.iter().enumerate() {
            if !sample::<S>(bin, &self.slots[bin.slot], y, x0, layer) {
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
    }
}

/// Copies a chunk of the gather's result.
#[inline(always)]
fn copy_gathered(rows: &[f32], width: usize, y: usize, x0: usize, color: &mut [[f32; CHUNK]; 3]) {
    let take = CHUNK.min(width - x0);
    for (p, color) in color.iter_mut().enumerate() {
        color[..take].copy_from_slice(&rows[(y * 3 + p) * width + x0..][..take]);
    }
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
        let strips = columns.start / STRIP..columns.end.div_ceil(STRIP).min(slot.source.across);
        let down = bin.height.div_ceil(CELL);
        strips.into_iter().any(|strip| slot.active[strip * down + y / CELL])
    };
    if !holds(above) && !holds(below) {
        return false;
    }
    match bin.scale {
        1 => upsample::<S, 1>(slot, bin.height, (above, below, share), x0, out),
        2 => upsample::<S, 2>(slot, bin.height, (above, below, share), x0, out),
        4 => upsample::<S, 4>(slot, bin.height, (above, below, share), x0, out),
        _ => upsample::<S, 8>(slot, bin.height, (above, below, share), x0, out),
    }
    true
}

/// A chunk of a bin of scale `S`, linear between rows `above` and `below` (by `share`) and between columns.
#[inline(always)]
fn upsample<V: Simd, const S: usize>(
    slot: &Slot,
    height: usize,
    (above, below, share): (usize, usize, f32),
    x0: usize,
    out: &mut [[f32; CHUNK]; 4],
) {
    let width = slot.source.across * STRIP;
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

/// Undoes the expansion of a chunk's highlights.
#[inline(always)]
fn compress_highlights(color: &mut [[f32; CHUNK]; 3], expansion: f32) {
    if expansion.is_finite() {
        for x in 0..CHUNK {
            let factor = compress(luminance(color[0][x], color[1][x], color[2][x]), expansion);
            for p in 0..3 {
                color[p][x] *= factor;
            }
        }
    }
}
