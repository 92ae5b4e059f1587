//! Pass `bin`: converts the picture to linear light, multiplies each pixel by its weight in every bin, and averages the
//! premultiplied result down to the bin's scale, with the coarse grid. The picture is read once for all bins.
//!
//! twin: shaders/blur/bin.wgsl

use std::ops::Range;

use pulp::{Simd, WithSimd};

use super::bin::{BinRows, BinSums};
use super::encode::CHUNK;
use super::fill::{HalfPictureBand, InpaintedBackground};
use super::tent::{MARGIN, PADDED_BLOCK};
use super::tiles::{BLOCK, Run, TILE_H, TILE_W, Tiles, extend_range};
use super::unpack::{InputFrame, Surfaces};
use crate::bokeh::plan::{BinWeight, CELL, MAX_BINS};
use crate::bokeh::reuse::Units;

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
    /// What is kept from the last frame; `None` is nothing.
    pub kept: Option<Kept<'a>>,
    /// Per block, the first bin that waits for inpainting, or [`NO_BIN`].
    pub first_pending: &'a mut [usize],
    /// Scratch memory of the thread.
    pub sums: &'a mut BandSums,
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

/// What the bins keep from earlier frames.
#[derive(Clone, Copy)]
pub struct Kept<'a> {
    /// The content that must be recomputed.
    pub content: &'a Units,
    /// The bins that may be kept.
    pub bins: [bool; MAX_BINS],
}

/// Which bins of a part of a block are made.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Making {
    Nothing,
    /// Those that are never kept.
    Fresh,
    All,
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

/// Sums of a thread for each bin.
pub struct BandSums(Vec<BinSums>);

impl BandSums {
    pub fn new() -> Self {
        Self(vec![BinSums::new(); MAX_BINS])
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
    /// Adds one block of columns to every bin that it contributes to, as far as they are not kept. In the first pass, a
    /// block with occluded pixels does only the bins in front of the first layer that needs inpainting; the passes for
    /// the layers behind ([`Inpainting::Done`]) do the others.
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
        // Adjacent units that make the same bins are done together.
        let step = self.kept.map_or(columns, |kept| kept.content.width_px());
        let end = block * BLOCK + columns;
        let mut x0 = block * BLOCK;
        while x0 < end {
            let making = self.find_making(x0);
            let mut next = x0 + step;
            while next < end && self.find_making(next) == making {
                next += step;
            }
            let columns = next.min(end) - x0;
            let is_whole = x0 == block * BLOCK && next >= end;
            if making != Making::Nothing {
                self.process_run(simd, Run { block, x0, columns, is_whole }, making);
            }
            x0 = next;
        }
    }

    /// Returns which bins of the unit at column `x0` are made.
    fn find_making(&self, x0: usize) -> Making {
        let Some(kept) = self.kept else { return Making::All };
        let columns = x0..x0 + kept.content.width_px();
        if kept.content.any_changed(columns.clone(), self.rows.clone()) {
            return Making::All;
        }
        let is_filled = matches!(self.inpainting, Inpainting::Done { .. });
        let has_fresh = self.bins.iter().zip(kept.bins).any(|(bin, is_kept)| {
            let Some(bin) = bin.as_ref().filter(|_| !is_kept) else { return false };
            // At full scale, no pixels of neighbours count; but the composite reads whole chunks.
            let chunks = columns.start - columns.start % CHUNK..columns.end.next_multiple_of(CHUNK);
            let (tile_columns, tile_rows) = match bin.scale {
                1 => (chunks.start / TILE_W..chunks.end / TILE_W, self.rows.start / TILE_H..self.rows.end / TILE_H),
                _ => self.tiles_around(chunks),
            };
            let overlaps = |weight| self.tiles.any_overlapping(weight, tile_columns, tile_rows);
            is_filled || bin.weight.as_ref().is_none_or(overlaps)
        });
        if has_fresh { Making::Fresh } else { Making::Nothing }
    }

    /// Returns the columns and rows of tiles of some columns of the picture, and one more on every side, because the
    /// averages of a cell include pixels of its neighbours.
    fn tiles_around(&self, columns: Range<usize>) -> (Range<usize>, Range<usize>) {
        (
            (columns.start / TILE_W).saturating_sub(1)..columns.end.div_ceil(TILE_W) + 1,
            (self.rows.start / TILE_H).saturating_sub(1)..self.rows.end.div_ceil(TILE_H) + 1,
        )
    }

    /// Returns which bins some columns of a block contribute to, and how many rows beyond the band these need; clears
    /// the other bins there.
    #[inline(always)]
    fn find_active_bins(&mut self, run: Run, making: Making) -> ([bool; MAX_BINS], isize) {
        let Run { block, x0, columns, .. } = run;
        let (tile_columns, tile_rows) = self.tiles_around(x0..x0 + columns.next_multiple_of(TILE_W));
        let is_filled = matches!(self.inpainting, Inpainting::Done { .. });
        let kept_bins = self.kept.filter(|_| making == Making::Fresh).map_or([false; MAX_BINS], |kept| kept.bins);
        let mut active = [false; MAX_BINS];
        let mut support = 0;
        for ((k, bin), active) in self.bins.iter_mut().enumerate().zip(&mut active) {
            let Some(bin) = bin else { continue };
            if !is_filled && k >= self.first_pending[block] || kept_bins[k] {
                continue;
            }
            *active = is_filled
                || bin
                    .weight
                    .as_ref()
                    .is_none_or(|weight| self.tiles.any_overlapping(weight, tile_columns.clone(), tile_rows.clone()));
            match *active {
                true => support = support.max(bin.scale as isize / 2),
                false => bin.clear(run),
            }
        }
        (active, support)
    }

    /// Adds some columns of a block to the bins.
    #[inline(always)]
    fn process_run<V: Simd>(&mut self, simd: V, run: Run, making: Making) {
        let Run { x0, columns, .. } = run;
        let (active, support) = self.find_active_bins(run, making);
        let is_read = matches!(self.inpainting, Inpainting::Pending { .. });
        if !active.contains(&true) && !is_read {
            return;
        }
        let mut surfaces: Surfaces<PADDED_BLOCK> = Surfaces::new();
        let left = x0 as isize - MARGIN as isize;
        let height = self.source.size.1 as isize;
        let (first, end) = (self.rows.start as isize, self.rows.end as isize);
        let last = end.min((height as usize).next_multiple_of(CELL) as isize);
        for y in first - support..last + support {
            let inside = y.clamp(0, height - 1) as usize;
            let ahead = (y + PREFETCH_ROWS).clamp(0, height - 1) as usize;
            self.source.prefetch(ahead, left, columns + 2 * MARGIN);
            self.source.unpack::<V, PADDED_BLOCK>(inside, left, columns + 2 * MARGIN, &mut surfaces);
            match &mut self.inpainting {
                Inpainting::NotNeeded => {}
                Inpainting::Pending { halves, .. } => {
                    if (first..end.min(height)).contains(&y) {
                        halves.add_row(x0, MARGIN..MARGIN + columns, y as usize, &surfaces);
                    }
                }
                Inpainting::Done { background, .. } => {
                    let width = self.source.size.0;
                    background.inpaint(simd, left, inside, width, &mut surfaces);
                }
            }
            let mut range = (f32::INFINITY, f32::NEG_INFINITY);
            extend_range(&mut range, &surfaces.back.0[3][..columns + 2 * MARGIN], |coc_px| coc_px);
            if surfaces.mixed {
                extend_range(&mut range, &surfaces.front.0[3][..columns + 2 * MARGIN], |coc_px| coc_px);
            }
            for ((bin, sums), _) in self.bins.iter_mut().zip(&mut self.sums.0).zip(active).filter(|(_, active)| *active)
            {
                let Some(bin) = bin else { continue };
                match bin.scale {
                    1 => bin.add_row::<V, 1>(simd, sums, run, first, y, &surfaces, range),
                    2 => bin.add_row::<V, 2>(simd, sums, run, first, y, &surfaces, range),
                    4 => bin.add_row::<V, 4>(simd, sums, run, first, y, &surfaces, range),
                    _ => bin.add_row::<V, 8>(simd, sums, run, first, y, &surfaces, range),
                }
            }
        }
    }
}

/// Returns the columns of a block inside the picture, rounded up to whole vectors of the coarsest bin.
fn block_columns(block: usize, width: usize) -> usize {
    (width - block * BLOCK).next_multiple_of(BLOCK / 2).min(BLOCK)
}
