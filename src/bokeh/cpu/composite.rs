//! Pass `composite`: combines the blurred bins, front to back, into one picture of the input's pixel kind.
//!
//! twin: shaders/blur/composite.wgsl, shaders/blur/surfaces.wgsl

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use std::ops::Range;

use pulp::{Simd, WithSimd};

use super::encode::{CHUNK, Encoder};
use super::enlarge::{CodeRows, Enlarge};
use super::layers::Layers;
use super::pixels::Sample;
use super::rows::{STRIP_ROW, Slot};
use super::sample::sample_bin;
use super::silhouettes::Silhouettes;
use super::tent::{VectorWeight, is_zero};
use super::tiles::{TILE_H, TILE_W, Tiles};
use super::unpack::{InputFrame, Surfaces, compression_factor, compute_coc_row};
use crate::bokeh::ladder::Compositing;
use crate::bokeh::plan::{Bin, BinWeight, CELL, MAX_BINS, Plan};
use crate::color::luminance;
use crate::compute::aligned::CacheAligned;
use crate::compute::simd::{madd, prefetch, store};

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
    pub scratch: &'a mut CompositeScratch,
    /// Output: whole rows of RGB.
    pub out: &'a mut [T],
}

/// Scratch memory of a thread.
pub struct CompositeScratch {
    layers: Layers,
    in_focus: Surfaces<CHUNK>,
    codes: CodeRows,
}

impl CompositeScratch {
    pub fn new() -> Self {
        Self { layers: Layers::new(), in_focus: Surfaces::new(), codes: CodeRows::new() }
    }
}

/// What adjacent tiles of a chunk show.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Content {
    /// The picture as it is.
    Still,
    /// One bin at a reduced scale, alone.
    One(usize),
    /// Several bins, or parts of one.
    Mixed,
}

impl<T: Sample> WithSimd for Composite<'_, T> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let width = self.plan.width;
        let out = std::mem::take(&mut self.out);
        self.scratch.layers.set_near_border(self.plan.near_border());
        for x0 in (0..width).step_by(CHUNK) {
            let mut spread = [false; MAX_BINS];
            for (spread, bin) in spread.iter_mut().zip(&self.plan.bins) {
                *spread = self.has_content(bin, x0);
            }
            let tiles = x0 / TILE_W..(x0 + CHUNK).min(width).div_ceil(TILE_W);
            let mut first = tiles.start;
            while first < tiles.end {
                let content = self.content_of(first, &spread);
                let next = (first + 1..tiles.end).find(|&tile| self.content_of(tile, &spread) != content);
                let next = next.unwrap_or(tiles.end);
                let columns = first * TILE_W - x0..(next * TILE_W).min(width) - x0;
                self.show(simd, content, x0, columns, out);
                first = next;
            }
        }
    }
}

impl<T: Sample> Composite<'_, T> {
    /// Returns what a tile shows, given which bins have content around.
    #[inline(always)]
    fn content_of(&self, tile: usize, spread: &[bool; MAX_BINS]) -> Content {
        let (bins, at) = (&self.plan.bins, self.y0 / TILE_H * self.tiles.across + tile);
        // In focus, and nothing near spreads here: the input is the result.
        if self.plan.compositing == Compositing::Layers
            && self.tiles.still[at]
            && !bins.iter().zip(spread).any(|(bin, &spread)| bin.near && spread)
        {
            return Content::Still;
        }
        match self.tiles.only_bin_of(at) {
            Some(only)
                if T::as_codes(&mut []).is_some() && bins[only].scale > 1 && self.slots[bins[only].slot].present =>
            {
                let is_alone = spread.iter().enumerate().all(|(k, &spread)| k == only || !spread);
                if is_alone { Content::One(only) } else { Content::Mixed }
            }
            _ => Content::Mixed,
        }
    }

    /// Whether a blurred bin has content in a chunk of this row of tiles.
    #[inline(always)]
    fn has_content(&self, bin: &Bin, x0: usize) -> bool {
        let slot = &self.slots[bin.slot];
        let rows = (self.y0 / bin.scale).saturating_sub(1)..((self.y0 + TILE_H) / bin.scale + 1).min(bin.height);
        let strips = slot.strips((x0 / bin.scale).saturating_sub(1)..(x0 + CHUNK) / bin.scale + 1);
        slot.present
            && strips.into_iter().any(|strip| {
                let first = rows.start - rows.start % CELL;
                (first..rows.end).step_by(CELL).any(|y| slot.is_active(strip, y, bin.height))
            })
    }

    /// Writes some `columns` of the chunk at column `x0` to the rows `out`.
    #[inline(always)]
    fn show<S: Simd>(&mut self, simd: S, content: Content, x0: usize, columns: Range<usize>, out: &mut [T]) {
        let width = self.plan.width;
        match content {
            Content::Still => {
                let pixels = &self.pixels[self.y0 * width * 3..];
                let columns = (x0 + columns.start) * 3..(x0 + columns.end) * 3;
                for (from, into) in pixels.chunks_exact(width * 3).zip(out.chunks_exact_mut(width * 3)) {
                    into[columns.clone()].copy_from_slice(&from[columns.clone()]);
                }
            }
            Content::One(only) => {
                let (bin, expansion) = (&self.plan.bins[only], self.frame.expansion);
                let Some(codes) = T::as_codes(out) else { return };
                Enlarge { bin, slot: &self.slots[bin.slot], y0: self.y0, x0, columns, width, expansion }.show(
                    simd,
                    codes,
                    &mut self.scratch.codes,
                );
            }
            Content::Mixed => self.composite(simd, x0, columns, out),
        }
    }

    /// Composites the bins of some columns of a chunk.
    #[inline(always)]
    fn composite<S: Simd>(&mut self, simd: S, x0: usize, columns: Range<usize>, out: &mut [T]) {
        let width = self.plan.width;
        let row_of_tiles = self.y0 / TILE_H * self.tiles.across;
        let tiles = (x0 + columns.start) / TILE_W..(x0 + columns.end).div_ceil(TILE_W);
        let ranges = &self.tiles.ranges[row_of_tiles + tiles.start..row_of_tiles + tiles.end];
        let rows = self.y0..self.y0 + (out.len() / (width * 3)).max(1);
        let may_be_near = self.plan.compositing == Compositing::Layers
            && self.silhouettes.may_be_near(x0 + columns.start..x0 + columns.end, rows.clone());
        if x0 + CHUNK < width {
            self.prefetch(x0 + CHUNK, rows.len());
        }
        let (mut color, mut coc_px) = (CacheAligned([[0.0; CHUNK]; 3]), [0.0; CHUNK]);
        // Whole vectors, also beyond the picture.
        let vectors = columns.start..columns.end.next_multiple_of(TILE_W);
        for (y, row) in rows.zip(out.chunks_exact_mut(width * 3)) {
            match self.plan.compositing {
                Compositing::Layers => {
                    self.read_layers(simd, y, x0, vectors.clone());
                    // Several surfaces are visible only near silhouettes; elsewhere a cheaper compositing suffices.
                    let proximity = if may_be_near { self.silhouettes.proximity(y, x0) } else { None };
                    let is_one_surface = proximity.is_none() && self.scratch.layers.have_one_surface(ranges);
                    if !is_one_surface {
                        compute_coc_row(self.frame, y, x0 + columns.start, &mut coc_px[columns.clone()]);
                    }
                    self.scratch.layers.composite(
                        simd,
                        vectors.clone(),
                        &proximity,
                        &coc_px,
                        is_one_surface,
                        &mut color,
                    );
                }
                Compositing::Select => self.select_by_coc(simd, y, x0, columns.clone(), &mut color.0),
                Compositing::Gather => copy_gathered(self.gathered, width, y, x0, &mut color.0),
            }
            compress_highlights(&mut color.0, columns.clone(), self.frame.expansion);
            let color = [&color.0[0][columns.clone()], &color.0[1][columns.clone()], &color.0[2][columns.clone()]];
            T::write(color, self.encoder, &mut row[(x0 + columns.start) * 3..(x0 + columns.end) * 3]);
        }
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

    /// Reads the bins with content in some `columns` of a chunk.
    #[inline(always)]
    fn read_layers<S: Simd>(&mut self, simd: S, y: usize, x0: usize, columns: Range<usize>) {
        let CompositeScratch { layers, in_focus, .. } = &mut *self.scratch;
        let plan = self.plan;
        layers.clear();
        let sharp = plan.sharp_bin();
        for (k, bin) in plan.bins.iter().enumerate() {
            let buffer = layers.next_buffer();
            let has_content = match Some(k) == sharp {
                true => {
                    read_in_focus(simd, self.frame, &plan.bin_weight(k), (x0, y), columns.clone(), in_focus, buffer)
                }
                false => sample_bin(simd, bin, &self.slots[bin.slot], y, x0, buffer),
            };
            if has_content {
                layers.push(bin);
            }
        }
    }

    /// Computes the colour of some `columns` of a chunk from the bins at each pixel's own CoC, by their weights.
    #[inline(always)]
    fn select_by_coc<S: Simd>(
        &mut self,
        simd: S,
        y: usize,
        x0: usize,
        columns: Range<usize>,
        color: &mut [[f32; CHUNK]; 3],
    ) {
        self.scratch.layers.clear();
        let layer = self.scratch.layers.next_buffer();
        let mut coc = [0.0; CHUNK];
        compute_coc_row(self.frame, y, x0 + columns.start, &mut coc[columns.clone()]);
        *color = [[0.0; CHUNK]; 3];
        for (k, bin) in self.plan.bins.iter().enumerate() {
            if !sample_bin(simd, bin, &self.slots[bin.slot], y, x0, layer) {
                continue;
            }
            let bin_weight = self.plan.bin_weight(k);
            for x in columns.clone() {
                let weight = bin_weight.at(coc[x]) / if layer[3][x] > 1e-6 { layer[3][x] } else { 1e-6 };
                for p in 0..3 {
                    color[p][x] = madd::<S>(layer[p][x], weight, color[p][x]);
                }
            }
        }
    }
}

/// Reads what is in focus in some `columns` of a chunk from the picture, as a layer. Returns false if there is nothing.
#[inline(always)]
fn read_in_focus<S: Simd>(
    simd: S,
    frame: &InputFrame<'_>,
    weight: &BinWeight,
    (x0, y): (usize, usize),
    columns: Range<usize>,
    surfaces: &mut Surfaces<CHUNK>,
    out: &mut [[f32; CHUNK]; 4],
) -> bool {
    frame.unpack::<S, CHUNK>(y, (x0 + columns.start) as isize, columns.len(), surfaces);
    let weight = VectorWeight::new(simd, &Some(*weight));
    let mut some = false;
    for x in (0..columns.len()).step_by(S::F32_LANES) {
        let taken = weight.surface_weights(simd, surfaces, x);
        some |= !is_zero(simd, taken);
        let values = weight.apply(simd, taken, surfaces, x);
        for p in 0..4 {
            store::<S>(&mut out[p], columns.start + x, values[p]);
        }
    }
    some
}

/// Copies a chunk of the gather's result.
#[inline(always)]
fn copy_gathered(rows: &[f32], width: usize, y: usize, x0: usize, color: &mut [[f32; CHUNK]; 3]) {
    let take = CHUNK.min(width - x0);
    for (p, color) in color.iter_mut().enumerate() {
        color[..take].copy_from_slice(&rows[(y * 3 + p) * width + x0..][..take]);
    }
}

/// Reverses the highlight expansion of some columns.
#[inline(always)]
fn compress_highlights(color: &mut [[f32; CHUNK]; 3], columns: Range<usize>, expansion: f32) {
    if expansion.is_finite() {
        for x in columns {
            let factor = compression_factor(luminance(color[0][x], color[1][x], color[2][x]), expansion);
            for p in 0..3 {
                color[p][x] *= factor;
            }
        }
    }
}
