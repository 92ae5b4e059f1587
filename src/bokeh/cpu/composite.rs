//! Pass `composite`: the blurred bins, front to back, become one picture; back to its pixels' kind.
//!
//! The pixels of one view tile the picture, so the coverages of two bins are disjoint, not independent: among the near
//! bins, and among the others, a bin fills what is left. The near ones lie over the others; what stays open takes the
//! colour of the hindmost.

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use pulp::{Simd, WithSimd};

use super::encode::{CHUNK, EncodeTable};
use super::pixels::Sample;
use super::rows::{PIECE, STRIP, STRIP_ROW, Slot};
use super::tiles::{TILE_H, TILE_W, Tiles};
use super::unpack::{Source, coc_row, compress};
use crate::bokeh::ladder::Compositing;
use crate::bokeh::plan::{Bin, HINDMOST_COVERAGE, MAX_BINS, Plan};
use crate::color::luminance;
use crate::compute::aligned::Line;
use crate::compute::simd::{fma, load, madd, prefetch, store};

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
    /// Memory of the thread.
    pub layers: &'a mut Layers,
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
        let (zero, one) = (simd.splat_f32s(0.0), simd.splat_f32s(1.0));
        Self { color: [zero; 3], open: one, hindmost: [zero; 3], known: zero }
    }

    /// Adds a vector of a bin behind all others, premultiplied colour and coverage.
    #[inline(always)]
    fn add(&mut self, simd: S, planes: &[[f32; CHUNK]; 4], x: usize) {
        let (zero, one) = (simd.splat_f32s(0.0), simd.splat_f32s(1.0));
        let mut layer = [zero; 4];
        for p in 0..4 {
            layer[p] = load::<S>(&planes[p], x);
        }
        if simd.first_true_m32s(simd.greater_than_f32s(layer[3], zero)) == S::F32_LANES {
            return;
        }
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
        let mut color = self.color;
        for p in 0..3 {
            color[p] = fma(simd, self.hindmost[p], scale, color[p]);
        }
        color
    }
}

/// The layers of a chunk, front to back: what bins have there.
pub struct Layers {
    planes: Box<[Line<[[f32; CHUNK]; 4]>]>,
    near: usize,
    count: usize,
}

impl Layers {
    /// Memory for all bins that there can be.
    pub fn new() -> Self {
        Self { planes: vec![Line([[0.0; CHUNK]; 4]); MAX_BINS].into(), near: 0, count: 0 }
    }

    /// Composites the layers, the near ones over the others, to linear light.
    #[inline(always)]
    fn flatten<S: Simd>(&self, simd: S, color: &mut Color) {
        let (near, rest) = self.planes[..self.count].split_at(self.near);
        let zero = simd.splat_f32s(0.0);
        for x in (0..CHUNK).step_by(S::F32_LANES) {
            let mut back = Pile::new(simd);
            for planes in rest {
                back.add(simd, &planes.0, x);
            }
            let mut light = back.with_rest_filled(simd);
            if !near.is_empty() {
                let mut front = Pile::new(simd);
                for planes in near {
                    front.add(simd, &planes.0, x);
                }
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
        let mut color = Line([[0.0; CHUNK]; 3]);
        for x0 in (0..width).step_by(CHUNK) {
            let take = CHUNK.min(width - x0);
            let tiles = row_of_tiles + x0 / TILE_W..row_of_tiles + (x0 + take).div_ceil(TILE_W);
            let still = self.tiles.still[tiles].iter().all(|&still| still);
            if x0 + CHUNK < width {
                self.prefetch(x0 + CHUNK, (out.len() / (width * 3)).max(1));
            }
            for (dy, row) in out.chunks_exact_mut(width * 3).enumerate() {
                let y = self.y0 + dy;
                let row = &mut row[x0 * 3..][..take * 3];
                match self.plan.compositing {
                    Compositing::Layers => {
                        if !self.read_layers(simd, y, x0, still) {
                            row.copy_from_slice(&self.pixels[(y * width + x0) * 3..][..take * 3]);
                            continue;
                        }
                        self.layers.flatten(simd, &mut color);
                    }
                    Compositing::Select => self.select(simd, y, x0, take, &mut color.0),
                    Compositing::Gather => copy_gathered(self.gathered, width, y, x0, &mut color.0),
                }
                compress_highlights(&mut color.0, self.frame.expansion);
                T::write(&color.0, self.encode, row);
            }
        }
    }
}

impl<T> Composite<'_, T> {
    /// Asks for what the bins have of a chunk of `rows` rows.
    #[inline(always)]
    fn prefetch(&self, x0: usize, rows: usize) {
        for bin in &self.plan.bins {
            let slot = &self.slots[bin.slot];
            if !slot.present {
                continue;
            }
            let first = (self.y0 / bin.scale).min(bin.height - 1);
            let end = ((self.y0 + rows - 1) / bin.scale + 2).min(bin.height);
            for strip in slot.strips(x0 / bin.scale..(x0 + CHUNK) / bin.scale) {
                if slot.is_active(strip, first, bin.height) {
                    prefetch(
                        &slot.out[(strip * bin.height + first) * STRIP_ROW..(strip * bin.height + end) * STRIP_ROW],
                    );
                }
            }
        }
    }

    /// Reads the bins that hold anything in a chunk; false where it is `still` and nothing near reaches it: it stays.
    #[inline(always)]
    fn read_layers<S: Simd>(&mut self, simd: S, y: usize, x0: usize, still: bool) -> bool {
        let (plan, layers) = (self.plan, &mut *self.layers);
        (layers.near, layers.count) = (0, 0);
        for bin in &plan.bins {
            if still && !bin.near && layers.count == 0 {
                return false;
            }
            if sample(simd, bin, &self.slots[bin.slot], y, x0, &mut layers.planes[layers.count].0) {
                layers.count += 1;
                layers.near += usize::from(bin.near);
            }
        }
        true
    }

    /// The colour of a chunk of `take` pixels, from the bins of each pixel's own CoC, by their share of it.
    #[inline(always)]
    fn select<S: Simd>(&mut self, simd: S, y: usize, x0: usize, take: usize, color: &mut [[f32; CHUNK]; 3]) {
        let layer = &mut self.layers.planes[0].0;
        let mut coc = [0.0; CHUNK];
        coc_row(self.frame, y, x0, &mut coc[..take]);
        *color = [[0.0; CHUNK]; 3];
        for (k, bin) in self.plan.bins.iter().enumerate() {
            if !sample(simd, bin, &self.slots[bin.slot], y, x0, layer) {
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
fn sample<S: Simd>(simd: S, bin: &Bin, slot: &Slot, y: usize, x0: usize, out: &mut [[f32; CHUNK]; 4]) -> bool {
    if !slot.present {
        return false;
    }
    let along = ((y as f32 + 0.5) / bin.scale as f32 - 0.5).clamp(0.0, (bin.height - 1) as f32);
    let (above, share) = (along as usize, along.fract());
    let below = (above + 1).min(bin.height - 1);
    let columns = (x0 / bin.scale).saturating_sub(1)..(x0 + CHUNK) / bin.scale + 1;
    let holds = |y: usize| slot.strips(columns.clone()).any(|strip| slot.is_active(strip, y, bin.height));
    if !holds(above) && !holds(below) {
        return false;
    }
    match bin.scale {
        1 => upsample::<S, 1>(simd, slot, bin.height, (above, below, share), x0, out),
        2 => upsample::<S, 2>(simd, slot, bin.height, (above, below, share), x0, out),
        4 => upsample::<S, 4>(simd, slot, bin.height, (above, below, share), x0, out),
        _ => upsample::<S, 8>(simd, slot, bin.height, (above, below, share), x0, out),
    }
    true
}

/// A chunk of a bin of scale `S`, linear between rows `above` and `below` (by `share`) and between columns.
#[inline(always)]
fn upsample<V: Simd, const S: usize>(
    simd: V,
    slot: &Slot,
    height: usize,
    (above, below, share): (usize, usize, f32),
    x0: usize,
    out: &mut [[f32; CHUNK]; 4],
) {
    let width = slot.source.across * STRIP;
    let share = simd.splat_f32s(share);
    let (first, end) = (x0 / S, ((x0 + CHUNK) / S).min(width));
    // A piece lies in one strip.
    let piece =
        |x: usize, y: usize, p: usize| &slot.out[((x / STRIP * height + y) * 4 + p) * STRIP + x % STRIP..][..PIECE];
    if S == 1 {
        // Rows and columns of the bin are those of the picture.
        for (p, out) in out.iter_mut().enumerate() {
            for x in (first..end).step_by(PIECE) {
                out[x - first..][..PIECE].copy_from_slice(piece(x, above, p));
            }
        }
        return;
    }
    // One column more on both sides than the chunk covers.
    let mut lines = Line([[0.0; CHUNK + 2 * PIECE]; 4]);
    for (p, line) in lines.0.iter_mut().enumerate() {
        for x in (first.saturating_sub(PIECE)..(end + PIECE).min(width)).step_by(PIECE) {
            let (a, b) = (piece(x, above, p), piece(x, below, p));
            let line = &mut line[PIECE + x - first..][..PIECE];
            for k in (0..PIECE).step_by(V::F32_LANES) {
                let (a, b) = (load::<V>(a, k), load::<V>(b, k));
                store::<V>(line, k, fma(simd, simd.sub_f32s(b, a), share, a));
            }
        }
        if first == 0 {
            line[PIECE - 1] = line[PIECE];
        }
        if end == width {
            line[PIECE + end - first] = line[PIECE + end - first - 1];
        }
    }
    for (line, out) in lines.0.iter().zip(out) {
        let (befores, line) = (&line[PIECE - 1..], &line[PIECE..]);
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
