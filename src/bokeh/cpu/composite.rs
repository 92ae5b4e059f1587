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
use super::sample::{SampledLines, read_in_focus, sample_bin};
use super::silhouettes::Silhouettes;
use super::tiles::{TILE_H, TILE_W, Tiles};
use super::unpack::{InputFrame, Surfaces, compression_factor, compute_coc_row};
use crate::bokeh::ladder::Compositing;
use crate::bokeh::plan::{Bin, CELL, Plan};
use crate::color::luminance;
use crate::compute::aligned::CacheAligned;
use crate::compute::simd::{madd, prefetch};

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
    lines: SampledLines,
    color: CacheAligned<[[f32; CHUNK]; 3]>,
    coc_px: [f32; CHUNK],
    /// What each tile of the row shows.
    contents: Vec<Content>,
}

impl CompositeScratch {
    pub fn new(width: usize) -> Self {
        Self {
            layers: Layers::new(),
            in_focus: Surfaces::new(),
            codes: CodeRows::new(),
            lines: CacheAligned([[0.0; _]; 4]),
            color: CacheAligned([[0.0; CHUNK]; 3]),
            coc_px: [0.0; CHUNK],
            contents: Vec::with_capacity(width.div_ceil(TILE_W)),
        }
    }
}

/// What adjacent tiles show.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Content {
    /// The picture as it is.
    Still,
    /// One bin at a reduced scale, alone.
    One(usize),
    /// Several blurred bins, or parts of one.
    Blurred,
    /// Something in focus, which may hide parts of one bin at a reduced scale, or of several.
    InFocus(Option<usize>),
}

impl Content {
    /// Returns the bin that is to be enlarged.
    fn enlarged(self) -> Option<usize> {
        match self {
            Self::One(bin) => Some(bin),
            Self::InFocus(bin) => bin,
            Self::Still | Self::Blurred => None,
        }
    }
}

impl<T: Sample> WithSimd for Composite<'_, T> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let out = std::mem::take(&mut self.out);
        self.scratch.layers.set_near_border(self.plan.near_border());
        let mut contents = std::mem::take(&mut self.scratch.contents);
        contents.clear();
        contents.extend((0..self.tiles.across).map(|tile| self.content_of(tile)));
        let width = self.plan.width;
        let columns_of = |tiles: &Range<usize>| tiles.start * TILE_W..(tiles.end * TILE_W).min(width);
        for run in runs(&contents, |content| content.enlarged(), usize::MAX) {
            if let Some(bin) = contents[run.start].enlarged() {
                self.enlarge(simd, &self.plan.bins[bin], columns_of(&run), out);
            }
        }
        for run in runs(&contents, |content| content, CHUNK / TILE_W) {
            self.show(simd, contents[run.start], columns_of(&run), out);
        }
        self.scratch.contents = contents;
    }
}

/// Returns runs of tiles, at most `longest`, that are alike in a property.
fn runs<P: PartialEq>(
    contents: &[Content],
    property: impl Fn(Content) -> P,
    longest: usize,
) -> impl Iterator<Item = Range<usize>> {
    let mut end = 0;
    std::iter::from_fn(move || {
        let first = end;
        let start = property(*contents.get(first)?);
        end += contents[first..].iter().take(longest).take_while(|&&content| property(content) == start).count();
        Some(first..end)
    })
}

impl<T: Sample> Composite<'_, T> {
    /// Returns what a tile shows.
    #[inline(always)]
    fn content_of(&self, tile: usize) -> Content {
        let (bins, at) = (&self.plan.bins, self.y0 / TILE_H * self.tiles.across + tile);
        let (only, sharp) = (self.tiles.only_bin_of(at), self.plan.sharp_bin());
        // In focus, and nothing near spreads here: the input is the result.
        if self.plan.compositing == Compositing::Layers
            && (self.tiles.still[at] || only.is_some() && only == sharp)
            && !bins.iter().any(|bin| bin.near && self.has_content(bin, tile))
        {
            return Content::Still;
        }
        let only = only.filter(|&only| self.slots[bins[only].slot].present);
        let behind = || bins.iter().position(|bin| self.has_content(bin, tile)).filter(|_| sharp.is_some());
        let blurred = only.or_else(behind).filter(|&blurred| {
            let mut others = bins.iter().enumerate().filter(|&(k, _)| k != blurred);
            bins[blurred].scale > 1
                && T::as_codes(&mut []).is_some()
                && !others.any(|(_, bin)| self.has_content(bin, tile))
        });
        let is_in_focus = |sharp| self.plan.bin_weight(sharp).overlaps(self.tiles.ranges[at]);
        match blurred {
            _ if sharp.is_some_and(is_in_focus) => Content::InFocus(blurred),
            Some(blurred) => Content::One(blurred),
            None => Content::Blurred,
        }
    }

    /// Whether a blurred bin has content in a tile.
    #[inline(always)]
    fn has_content(&self, bin: &Bin, tile: usize) -> bool {
        let (slot, x0) = (&self.slots[bin.slot], tile * TILE_W);
        let rows = (self.y0 / bin.scale).saturating_sub(1)..((self.y0 + TILE_H) / bin.scale + 1).min(bin.height);
        let strips = slot.strips((x0 / bin.scale).saturating_sub(1)..(x0 + TILE_W) / bin.scale + 1);
        slot.present
            && strips.into_iter().any(|strip| {
                let first = rows.start - rows.start % CELL;
                (first..rows.end).step_by(CELL).any(|y| slot.is_active(strip, y, bin.height))
            })
    }

    /// Writes some `columns` of a bin at a reduced scale to the rows `out`.
    #[inline(always)]
    fn enlarge<S: Simd>(&mut self, simd: S, bin: &Bin, columns: Range<usize>, out: &mut [T]) {
        self.prefetch(bin, columns.clone());
        let (slot, width, expansion) = (&self.slots[bin.slot], self.plan.width, self.frame.expansion);
        if let Some(codes) = T::as_codes(out) {
            Enlarge { bin, slot, y0: self.y0, columns, width, expansion }.show(simd, codes, &mut self.scratch.codes);
        }
    }

    /// Writes some `columns`, where no bin is alone, to the rows `out`.
    #[inline(always)]
    fn show<S: Simd>(&mut self, simd: S, content: Content, columns: Range<usize>, out: &mut [T]) {
        let width = self.plan.width;
        let rows = self.y0..self.y0 + (out.len() / (width * 3)).max(1);
        if matches!(content, Content::Blurred | Content::InFocus(_)) {
            self.plan.bins.iter().for_each(|bin| self.prefetch(bin, columns.clone()));
            rows.clone().for_each(|y| self.frame.prefetch(y, columns.start as isize, columns.len()));
        }
        let may_be_near =
            self.plan.compositing == Compositing::Layers && self.silhouettes.may_be_near(columns.clone(), rows.clone());
        for (y, row) in rows.zip(out.chunks_exact_mut(width * 3)) {
            match content {
                Content::Still => self.copy_source(y, columns.clone(), row),
                Content::One(_) => {}
                Content::Blurred => {
                    self.scratch.layers.clear();
                    self.composite_columns(simd, (columns.start, y), 0..columns.len(), may_be_near, row);
                }
                Content::InFocus(behind) => {
                    self.composite_in_focus(simd, y, columns.clone(), behind.is_some(), may_be_near, row)
                }
            }
        }
    }

    /// Copies some `columns` of a row of the picture.
    #[inline(always)]
    fn copy_source(&self, y: usize, columns: Range<usize>, row: &mut [T]) {
        let values = columns.start * 3..columns.end * 3;
        row[values.clone()].copy_from_slice(&self.pixels[y * self.plan.width * 3..][values]);
    }

    /// Composites what is in focus over the bins of a row at some columns of the picture, a chunk at most. What is
    /// behind may be `shown` already.
    #[inline(always)]
    fn composite_in_focus<S: Simd>(
        &mut self,
        simd: S,
        y: usize,
        columns: Range<usize>,
        is_shown: bool,
        may_be_near: bool,
        row: &mut [T],
    ) {
        let (x0, count) = (columns.start, columns.len());
        let CompositeScratch { layers, in_focus, .. } = &mut *self.scratch;
        layers.clear();
        // Whole vectors, also beyond the picture.
        let (weight, vectors) = (self.plan.bin_weight(0), count.next_multiple_of(TILE_W));
        read_in_focus(simd, self.frame, &weight, (x0, y), vectors, in_focus, layers.next_buffer());
        layers.push(&self.plan.bins[0]);
        // Only what is between the outermost vectors that are partly in focus is composited.
        let mut partly = count..0;
        for x in (0..count).step_by(S::F32_LANES) {
            match self.scratch.layers.front_covers(simd, x) {
                Some(true) => self.copy_source(y, x0 + x..x0 + (x + S::F32_LANES).min(count), row),
                Some(false) if is_shown => {}
                _ => partly = partly.start.min(x)..(x + S::F32_LANES).min(count),
            }
        }
        if !partly.is_empty() {
            self.composite_columns(simd, (x0, y), partly, may_be_near, row);
        }
    }

    /// Composites some `columns` of the chunk at column `x0` of row `y`, behind what is in focus.
    #[inline(always)]
    fn composite_columns<S: Simd>(
        &mut self,
        simd: S,
        (x0, y): (usize, usize),
        columns: Range<usize>,
        may_be_near: bool,
        row: &mut [T],
    ) {
        let of_picture = x0 + columns.start..x0 + columns.end;
        match self.plan.compositing {
            Compositing::Layers => {
                let CompositeScratch { layers, in_focus, lines, color, coc_px, .. } = &mut *self.scratch;
                let is_coc_known = !layers.is_empty() && !in_focus.mixed;
                for bin in &self.plan.bins {
                    let (slot, buffer) = (&self.slots[bin.slot], layers.next_buffer());
                    if sample_bin(simd, bin, slot, (x0, y), columns.clone(), lines, buffer) {
                        layers.push(bin);
                    }
                }
                // Several surfaces are visible only near silhouettes; elsewhere a cheaper compositing suffices.
                let proximity = if may_be_near { self.silhouettes.proximity(y, x0) } else { None };
                let tiles = self.y0 / TILE_H * self.tiles.across;
                let tiles = tiles + of_picture.start / TILE_W..tiles + of_picture.end.div_ceil(TILE_W);
                let is_one_surface = proximity.is_none() && layers.have_one_surface(&self.tiles.ranges[tiles]);
                if !is_one_surface && !is_coc_known {
                    compute_coc_row(self.frame, y, of_picture.start, &mut coc_px[columns.clone()]);
                }
                let coc_px = if is_coc_known { &in_focus.back.0[3] } else { coc_px };
                let vectors = columns.start..columns.end.next_multiple_of(S::F32_LANES);
                layers.composite(simd, vectors, &proximity, coc_px, is_one_surface, color);
            }
            Compositing::Select => self.select_by_coc(simd, (x0, y), columns.clone()),
            Compositing::Gather => copy_gathered(self.gathered, self.plan.width, y, x0, &mut self.scratch.color.0),
        }
        let color = &mut self.scratch.color.0;
        compress_highlights(color, columns.clone(), self.frame.expansion);
        T::write::<S>(color, columns, self.encoder, &mut row[of_picture.start * 3..of_picture.end * 3]);
    }

    /// Prefetches what some `columns` show of a bin.
    #[inline(always)]
    fn prefetch(&self, bin: &Bin, columns: Range<usize>) {
        let slot = &self.slots[bin.slot];
        let rows = (self.y0 / bin.scale).saturating_sub(1)..((self.y0 + TILE_H) / bin.scale + 1).min(bin.height);
        for strip in slot.strips(columns.start / bin.scale..columns.end / bin.scale).filter(|_| slot.present) {
            if slot.is_active(strip, rows.start, bin.height) {
                let first = strip * bin.height;
                prefetch(&slot.out[(first + rows.start) * STRIP_ROW..(first + rows.end) * STRIP_ROW]);
            }
        }
    }

    /// Computes the colour of some `columns` of a chunk from the bins at each pixel's own CoC, by their weights.
    #[inline(always)]
    fn select_by_coc<S: Simd>(&mut self, simd: S, (x0, y): (usize, usize), columns: Range<usize>) {
        let CompositeScratch { layers, lines, color: CacheAligned(color), coc_px: coc, .. } = &mut *self.scratch;
        let layer = layers.next_buffer();
        color.as_flattened_mut().fill(0.0);
        compute_coc_row(self.frame, y, x0 + columns.start, &mut coc[columns.clone()]);
        for (k, bin) in self.plan.bins.iter().enumerate() {
            if !sample_bin(simd, bin, &self.slots[bin.slot], (x0, y), columns.clone(), lines, layer) {
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
