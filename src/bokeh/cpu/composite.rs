//! Pass `composite`: combines the blurred bins, front to back, into one picture of the input's pixel kind.
//!
//! twin: shaders/blur/composite.wgsl, shaders/blur/surfaces.wgsl

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use pulp::{Simd, WithSimd};

use super::encode::{CHUNK, Encoder};
use super::held::HeldRow;
use super::layers::Layers;
use super::pixels::Sample;
use super::rows::{COPY_WIDTH, STRIP, STRIP_ROW, Slot};
use super::silhouettes::Silhouettes;
use super::tiles::{TILE_H, TILE_W, Tiles};
use super::unpack::{InputFrame, compression_factor, compute_coc_row};
use crate::bokeh::ladder::Compositing;
use crate::bokeh::plan::{Bin, CELL, Plan};
use crate::color::luminance;
use crate::compute::aligned::CacheAligned;
use crate::compute::simd::{fma, load, madd, prefetch, store};

/// Computes rows `y0..` of the result: a row of tiles.
pub struct Composite<'a, T> {
    pub plan: &'a Plan,
    pub slots: &'a [Slot],
    /// Tiles, some of which stay unchanged.
    pub tiles: &'a Tiles,
    /// Where the background is visible past a silhouette.
    pub silhouettes: &'a Silhouettes,
    /// The input frame and its pixels.
    pub frame: &'a InputFrame<'a>,
    pub pixels: &'a [T],
    /// Result of the gather, `[row][3][width]`.
    pub gathered: &'a [f32],
    /// From linear light to codes.
    pub encoder: &'a Encoder,
    pub y0: usize,
    /// Scratch memory of the thread.
    pub layers: &'a mut Layers,
    /// The result of the last frame, where it may be kept.
    pub held: Option<HeldRow<'a>>,
    /// Output: whole rows of RGB.
    pub out: &'a mut [T],
}

impl<T: Sample> WithSimd for Composite<'_, T> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let width = self.plan.width;
        let row_of_tiles = self.y0 / TILE_H * self.tiles.across;
        let out = std::mem::take(&mut self.out);
        self.layers.set_near_border(self.plan.near_border());
        let layered = self.plan.compositing == Compositing::Layers;
        let (mut color, mut coc_px) = (CacheAligned([[0.0; CHUNK]; 3]), [0.0; CHUNK]);
        for x0 in (0..width).step_by(CHUNK) {
            let take = CHUNK.min(width - x0);
            let tiles = row_of_tiles + x0 / TILE_W..row_of_tiles + (x0 + take).div_ceil(TILE_W);
            let ranges = &self.tiles.ranges[tiles.clone()];
            let still = self.tiles.still[tiles].iter().all(|&still| still);
            let rows = self.y0..self.y0 + (out.len() / (width * 3)).max(1);
            if self.show_held(out, x0, take, still) {
                continue;
            }
            let may_be_near = layered && self.silhouettes.may_be_near(x0..x0 + CHUNK, rows.clone());
            if x0 + CHUNK < width {
                self.prefetch(x0 + CHUNK, rows.len());
            }
            for (dy, row) in out.chunks_exact_mut(width * 3).enumerate() {
                let y = self.y0 + dy;
                let row = &mut row[x0 * 3..][..take * 3];
                match self.plan.compositing {
                    Compositing::Layers => {
                        // In focus, and nothing near spreads here: the input is the result.
                        if !self.read_layers(simd, y, x0, still) {
                            row.copy_from_slice(&self.pixels[(y * width + x0) * 3..][..take * 3]);
                            continue;
                        }
                        // Several surfaces are visible only near silhouettes; elsewhere a cheaper compositing suffices.
                        let proximity = if may_be_near { self.silhouettes.proximity(y, x0) } else { None };
                        let is_one_surface = proximity.is_none() && self.layers.have_one_surface(ranges);
                        if !is_one_surface {
                            compute_coc_row(self.frame, y, x0, &mut coc_px[..take]);
                        }
                        self.layers.composite(simd, &proximity, &coc_px, is_one_surface, &mut color);
                    }
                    Compositing::Select => self.select_by_coc(simd, y, x0, take, &mut color.0),
                    Compositing::Gather => copy_gathered(self.gathered, width, y, x0, &mut color.0),
                }
                compress_highlights(&mut color.0, self.frame.expansion);
                T::write(&color.0, self.encoder, row);
            }
            self.hold(out, x0, take, still);
        }
    }
}

impl<T> Composite<'_, T> {
    /// Shows a chunk of the last result again, if nothing changed and no bin shows there that is never kept.
    #[inline(always)]
    fn show_held(&mut self, out: &mut [T], x0: usize, take: usize, still: bool) -> bool
    where
        T: Sample,
    {
        let Some(HeldRow { units: Some(units), picture, is_complete }) = &self.held else { return false };
        let rows = self.y0..self.y0 + TILE_H;
        if still || !is_complete[x0 / CHUNK] || units.any_changed(x0..x0 + take, rows) || self.has_fresh_content(x0) {
            return false;
        }
        copy_chunk(picture, T::as_codes(out), self.plan.width, x0..x0 + take);
        true
    }

    /// Keeps a chunk of the result for later frames.
    #[inline(always)]
    fn hold(&mut self, out: &mut [T], x0: usize, take: usize, still: bool)
    where
        T: Sample,
    {
        let is_complete = !still && self.held.is_some() && !self.has_fresh_content(x0);
        let Some(held) = &mut self.held else { return };
        held.is_complete[x0 / CHUNK] = is_complete;
        if is_complete && let Some(out) = T::as_codes(out) {
            copy_chunk(out, Some(held.picture), self.plan.width, x0..x0 + take);
        }
    }

    /// Whether a bin whose result is never kept shows in a chunk of this row of tiles.
    #[inline(always)]
    fn has_fresh_content(&self, x0: usize) -> bool {
        let fresh = self.plan.bins.iter().filter(|bin| !bin.is_kept());
        fresh.filter(|bin| self.slots[bin.slot].present).any(|bin| {
            let slot = &self.slots[bin.slot];
            let rows = (self.y0 / bin.scale).saturating_sub(1)..((self.y0 + TILE_H) / bin.scale + 1).min(bin.height);
            let strips = slot.strips((x0 / bin.scale).saturating_sub(1)..(x0 + CHUNK) / bin.scale + 1);
            strips.into_iter().any(|strip| {
                let first = rows.start - rows.start % CELL;
                (first..rows.end).step_by(CELL).any(|y| slot.is_active(strip, y, bin.height))
            })
        })
    }

    /// Prefetches the bins of a chunk of `rows` rows.
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

    /// Reads the bins with content in a chunk. Returns false if the chunk stays unchanged: it is `still` and nothing
    /// near spreads there.
    #[inline(always)]
    fn read_layers<S: Simd>(&mut self, simd: S, y: usize, x0: usize, still: bool) -> bool {
        let (plan, layers) = (self.plan, &mut *self.layers);
        layers.clear();
        for bin in &plan.bins {
            if still && !bin.near && layers.count() == 0 {
                return false;
            }
            if sample_bin(simd, bin, &self.slots[bin.slot], y, x0, layers.next_buffer()) {
                layers.push(bin);
            }
        }
        true
    }

    /// Computes the colour of a chunk of `take` pixels from the bins at each pixel's own CoC, by their weights.
    #[inline(always)]
    fn select_by_coc<S: Simd>(&mut self, simd: S, y: usize, x0: usize, take: usize, color: &mut [[f32; CHUNK]; 3]) {
        self.layers.clear();
        let layer = self.layers.next_buffer();
        let mut coc = [0.0; CHUNK];
        compute_coc_row(self.frame, y, x0, &mut coc[..take]);
        *color = [[0.0; CHUNK]; 3];
        for (k, bin) in self.plan.bins.iter().enumerate() {
            if !sample_bin(simd, bin, &self.slots[bin.slot], y, x0, layer) {
                continue;
            }
            let bin_weight = self.plan.bin_weight(k);
            for x in 0..CHUNK {
                let weight = bin_weight.at(coc[x]) / if layer[3][x] > 1e-6 { layer[3][x] } else { 1e-6 };
                for p in 0..3 {
                    color[p][x] = madd::<S>(layer[p][x], weight, color[p][x]);
                }
            }
        }
    }
}

/// Copies some columns of the rows of a picture.
fn copy_chunk(from: &[u8], to: Option<&mut [u8]>, width: usize, columns: std::ops::Range<usize>) {
    let Some(to) = to else { return };
    let columns = columns.start * 3..columns.end * 3;
    for (from, to) in from.chunks_exact(width * 3).zip(to.chunks_exact_mut(width * 3)) {
        to[columns.clone()].copy_from_slice(&from[columns.clone()]);
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

/// Reads a chunk of a bin at the picture's scale with linear interpolation. Returns false if it is empty.
#[inline(always)]
fn sample_bin<S: Simd>(simd: S, bin: &Bin, slot: &Slot, y: usize, x0: usize, out: &mut [[f32; CHUNK]; 4]) -> bool {
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

/// Reverses the highlight expansion of a chunk.
#[inline(always)]
fn compress_highlights(color: &mut [[f32; CHUNK]; 3], expansion: f32) {
    if expansion.is_finite() {
        for x in 0..CHUNK {
            let factor = compression_factor(luminance(color[0][x], color[1][x], color[2][x]), expansion);
            for p in 0..3 {
                color[p][x] *= factor;
            }
        }
    }
}
