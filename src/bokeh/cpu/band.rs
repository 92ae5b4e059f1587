//! Pass `bin`: converts the picture to linear light, multiplies each pixel by its weight in every bin, and averages the
//! premultiplied result down to the bin's scale, with the coarse grid. The picture is read once for all bins.
//!
//! twin: shaders/blur/bin.wgsl

use std::ops::Range;

use pulp::{Simd, WithSimd};

use super::bin::{BinRows, BinSums, Row};
use super::fill::{HalfPictureBand, InpaintedBackground};
use super::rows::PIECE;
use super::tent::{MARGIN, PADDED_BLOCK};
use super::tiles::{BLOCK, Run, TILE_H, TILE_W, Tiles, extend_range};
use super::unpack::{InputFrame, Surfaces};
use crate::bokeh::plan::{BinWeight, CELL, MAX_BINS};

/// A band of rows of the picture: whole rows of cells of every bin.
pub struct Band<'a> {
    pub source: InputFrame<'a>,
    pub tiles: &'a Tiles,
    /// Range of rows.
    pub rows: Range<usize>,
    /// Buffers of the bins to fill, by the bin's index in the plan.
    pub bins: [Option<BinRows<'a>>; MAX_BINS],
    /// Treatment of pixels that near objects occlude.
    pub inpainting: Inpainting<'a>,
    /// Per block, the first bin that waits for inpainting, or [`NO_BIN`].
    pub first_pending: &'a mut [usize],
    /// Scratch memory of the thread.
    pub scratch: &'a mut BandScratch,
}

/// How a band treats pixels that near objects occlude.
pub enum Inpainting<'a> {
    /// There are no near objects.
    NotNeeded,
    /// Before inpainting: a layer and those behind it wait in blocks where anything is occluded for it. The picture at
    /// half size is written.
    Pending { layers: &'a [Layer], halves: HalfPictureBand<'a> },
    /// After inpainting: fills the blocks where a layer waited, for its bins only.
    Done { first: usize, background: InpaintedBackground<'a> },
}

/// What some columns of a band contribute to.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Content {
    /// One bin at a reduced scale, as a whole.
    One(usize),
    /// Any bins, by their weights.
    Mixed,
}

/// A layer behind others: its first bin, and the weight of a pixel's own content in it.
#[derive(Clone, Copy)]
pub struct Layer {
    pub first: usize,
    pub visible_weight: BinWeight,
}

/// Rows between the row being processed and the row being prefetched.
const PREFETCH_ROWS: isize = 2;

/// No bin waits.
pub const NO_BIN: usize = usize::MAX;

/// Scratch memory of a thread: the sums of each bin, and a row of pixels.
pub struct BandScratch {
    sums: Vec<BinSums>,
    surfaces: Surfaces<PADDED_BLOCK>,
}

impl BandScratch {
    pub fn new() -> Self {
        Self { sums: vec![BinSums::new(); MAX_BINS], surfaces: Surfaces::new() }
    }
}

impl WithSimd for Band<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        for block in 0..self.first_pending.len() {
            self.process_block(simd, block);
        }
        for bin in self.bins.iter_mut().flatten() {
            bin.repeat_last_column();
        }
    }
}

impl Band<'_> {
    /// Adds one block of columns to every bin that it contributes to. In the first pass, a block with occluded pixels
    /// does only the bins in front of the first layer that needs inpainting; the passes for the layers behind
    /// ([`Inpainting::Done`]) do the others.
    #[inline(always)]
    fn process_block<V: Simd>(&mut self, simd: V, block: usize) {
        let columns = block_columns(block, self.source.size.0);
        let (tile_columns, tile_rows) = self.tiles_around(block * BLOCK..(block + 1) * BLOCK);
        match &self.inpainting {
            Inpainting::NotNeeded => self.first_pending[block] = NO_BIN,
            Inpainting::Pending { layers, .. } => {
                let hides = |layer: &&Layer| {
                    self.tiles.any_partly_outside(&layer.visible_weight, tile_columns.clone(), tile_rows.clone())
                };
                self.first_pending[block] = layers.iter().find(hides).map_or(NO_BIN, |layer| layer.first);
            }
            Inpainting::Done { first, .. } if self.first_pending[block] > *first => return,
            Inpainting::Done { .. } => {}
        }
        // Adjacent columns of equal content are done together, in whole pieces of every bin.
        let coarsest = self.bins.iter().flatten().map(|bin| bin.scale).max().unwrap_or(1);
        let step = TILE_W.max(PIECE * coarsest);
        let end = block * BLOCK + columns;
        let last = end.min(self.source.size.0);
        let mut x0 = block * BLOCK;
        while x0 < last {
            let content = self.content_of(block, x0..x0 + step);
            let mut next = x0 + step;
            while next < last && self.content_of(block, next..next + step) == content {
                next += step;
            }
            let columns = next.min(end) - x0;
            let is_whole = x0 == block * BLOCK && next >= last;
            self.process_run(simd, Run { block, x0, columns, is_whole }, content);
            x0 = next;
        }
    }

    /// Returns what some columns of a block contribute to.
    fn content_of(&self, block: usize, columns: Range<usize>) -> Content {
        let (tile_columns, tile_rows) = self.tiles_around(columns);
        match self.tiles.only_bin(tile_columns, tile_rows) {
            Some(k)
                if k < self.first_pending[block]
                    && !matches!(self.inpainting, Inpainting::Done { .. })
                    && self.bins[k].as_ref().is_some_and(|bin| bin.scale > 1) =>
            {
                Content::One(k)
            }
            _ => Content::Mixed,
        }
    }

    /// Returns the columns and rows of tiles of some columns of the picture, and one more on every side, because the
    /// averages of a cell include pixels of its neighbours.
    fn tiles_around(&self, columns: Range<usize>) -> (Range<usize>, Range<usize>) {
        (
            (columns.start / TILE_W).saturating_sub(1)..columns.end.div_ceil(TILE_W) + 1,
            (self.rows.start / TILE_H).saturating_sub(1)..self.rows.end.div_ceil(TILE_H) + 1,
        )
    }

    /// Returns how many bins some columns of a block contribute to, and these in front; and how many rows beyond the band
    /// they need. Clears the other bins there.
    #[inline(always)]
    fn find_active_bins(&mut self, run: Run, content: Content) -> (usize, [usize; MAX_BINS], isize) {
        let Run { block, x0, columns, .. } = run;
        let (tile_columns, tile_rows) = self.tiles_around(x0..x0 + columns.next_multiple_of(TILE_W));
        let is_filled = matches!(self.inpainting, Inpainting::Done { .. });
        let (mut count, mut active, mut support) = (0, [0; MAX_BINS], 0);
        for (k, bin) in self.bins.iter_mut().enumerate() {
            let Some(bin) = bin else { continue };
            if !is_filled && k >= self.first_pending[block] {
                continue;
            }
            let is_active = match content {
                Content::One(only) => k == only,
                Content::Mixed => {
                    let overlaps = |weight| self.tiles.any_overlapping(weight, tile_columns.clone(), tile_rows.clone());
                    is_filled || bin.weight.as_ref().is_none_or(overlaps)
                }
            };
            match is_active {
                true => {
                    (active[count], support) = (k, support.max(bin.scale as isize / 2));
                    count += 1;
                }
                false => bin.clear(run),
            }
        }
        (count, active, support)
    }

    /// Adds some columns of a block to the bins.
    #[inline(always)]
    fn process_run<V: Simd>(&mut self, simd: V, run: Run, content: Content) {
        let Run { x0, columns, .. } = run;
        let (count, active, support) = self.find_active_bins(run, content);
        let is_read = matches!(self.inpainting, Inpainting::Pending { .. });
        if count == 0 && !is_read {
            return;
        }
        let (tile_columns, tile_rows) = self.tiles_around(x0..x0 + columns);
        let radius_px = self.tiles.only_coc(tile_columns, tile_rows);
        let BandScratch { sums, surfaces } = &mut *self.scratch;
        surfaces.mixed = false;
        let (left, padded) = (x0 as isize - MARGIN as isize, columns + 2 * MARGIN);
        let height = self.source.size.1 as isize;
        let (first, end) = (self.rows.start as isize, self.rows.end as isize);
        let last = end.min((height as usize).next_multiple_of(CELL) as isize);
        for y in first - support..last + support {
            let inside = y.clamp(0, height - 1) as usize;
            let ahead = (y + PREFETCH_ROWS).clamp(0, height - 1) as usize;
            self.source.prefetch(ahead, left, padded);
            match content {
                Content::One(_) if radius_px.is_some() && !is_read => {
                    self.source.unpack_light::<V, PADDED_BLOCK>(inside, left, padded, &mut surfaces.back);
                }
                _ => self.source.unpack::<V, PADDED_BLOCK>(inside, left, padded, surfaces),
            }
            match &mut self.inpainting {
                Inpainting::NotNeeded => {}
                Inpainting::Pending { halves, .. } => {
                    if (first..end.min(height)).contains(&y) {
                        halves.add_row(x0, MARGIN..MARGIN + columns, y as usize, surfaces);
                    }
                }
                Inpainting::Done { background, .. } => {
                    let width = self.source.size.0;
                    background.inpaint(simd, left, inside, width, surfaces);
                }
            }
            let row = match content {
                Content::One(_) => Row::Whole(radius_px),
                Content::Mixed => {
                    let mut range = (f32::INFINITY, f32::NEG_INFINITY);
                    extend_range(simd, &mut range, &surfaces.back.0[3][..padded]);
                    if surfaces.mixed {
                        extend_range(simd, &mut range, &surfaces.front.0[3][..padded]);
                    }
                    Row::Weighted(range)
                }
            };
            let at = (run, y - first);
            for &k in &active[..count] {
                let (Some(bin), sums) = (&mut self.bins[k], &mut sums[k]) else { continue };
                match bin.scale {
                    1 => bin.add_row::<V, 1>(simd, sums, at, surfaces, row),
                    2 => bin.add_row::<V, 2>(simd, sums, at, surfaces, row),
                    4 => bin.add_row::<V, 4>(simd, sums, at, surfaces, row),
                    _ => bin.add_row::<V, 8>(simd, sums, at, surfaces, row),
                }
            }
        }
    }
}

/// Returns the columns of a block inside the picture, rounded up to whole vectors of the coarsest bin.
fn block_columns(block: usize, width: usize) -> usize {
    (width - block * BLOCK).next_multiple_of(BLOCK / 2).min(BLOCK)
}
