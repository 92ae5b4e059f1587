//! Pass `bin`: converts the picture to linear light, multiplies each pixel by its weight in every bin, and averages the
//! premultiplied result down to the bin's scale, with the coarse grid. The picture is read once for all bins.
//!
//! twin: shaders/bin.wgsl

use pulp::{Simd, WithSimd};

use super::bin::{BinRows, BinSums};
use super::fill::{Behind, HalfRows};
use super::tent::{MARGIN, WIDE};
use super::tiles::{BLOCK, TILE_H, TILE_W, Tiles, widen};
use super::unpack::{Source, Surfaces};
use crate::bokeh::plan::{BinWeight, CELL, MAX_BINS};

/// A band of rows of the picture: whole rows of cells of every bin.
pub struct Band<'a> {
    pub source: Source<'a>,
    pub tiles: &'a Tiles,
    /// Range of rows.
    pub rows: std::ops::Range<usize>,
    /// Buffers of the bins to fill, by the bin's index in the plan.
    pub bins: [Option<BinRows<'a>>; MAX_BINS],
    /// Treatment of pixels that near objects occlude.
    pub hidden: Hidden<'a>,
    /// Per block, the first bin that waits for inpainting, or [`NONE`].
    pub waits: &'a mut [usize],
    /// Scratch memory of the thread.
    pub sums: &'a mut BandSums,
}

/// How a band treats pixels that near objects occlude.
pub enum Hidden<'a> {
    /// There are no near objects.
    Nothing,
    /// Before inpainting: a layer and those behind it wait in blocks where anything is occluded for it. The picture at
    /// half size is written.
    Waits { layers: &'a [Layer], halves: HalfRows<'a> },
    /// After inpainting: fills the blocks where a layer waited, for its bins only.
    Filled { first: usize, behind: Behind<'a> },
}

/// A layer behind others: its first bin, and the weight of a pixel's own content in it.
#[derive(Clone, Copy)]
pub struct Layer {
    pub first: usize,
    pub unhidden: BinWeight,
}

/// Rows between the row being processed and the row being prefetched.
const AHEAD: isize = 2;

/// No bin waits.
pub const NONE: usize = usize::MAX;

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
        for block in 0..self.waits.len() {
            self.block(simd, block);
        }
        for bin in self.bins.iter_mut().flatten() {
            bin.repeat_end();
        }
    }
}

impl Band<'_> {
    /// Adds one block of columns to every bin that it contributes to. In the first pass, a block with occluded pixels
    /// does only the bins in front of the first layer that needs inpainting; the passes for the layers behind
    /// ([`Hidden::Filled`]) do the others.
    #[inline(always)]
    fn block<V: Simd>(&mut self, simd: V, block: usize) {
        // One tile more on every side, because the averages of a cell include pixels of its neighbours.
        let tile_columns = (block * (BLOCK / TILE_W)).saturating_sub(1)..(block + 1) * (BLOCK / TILE_W) + 1;
        let tile_rows = (self.rows.start / TILE_H).saturating_sub(1)..self.rows.end.div_ceil(TILE_H) + 1;
        match &self.hidden {
            Hidden::Nothing => self.waits[block] = NONE,
            Hidden::Waits { layers, .. } => {
                let hides =
                    |layer: &&Layer| self.tiles.any_outside(&layer.unhidden, tile_columns.clone(), tile_rows.clone());
                self.waits[block] = layers.iter().find(hides).map_or(NONE, |layer| layer.first);
            }
            Hidden::Filled { first, .. } if self.waits[block] > *first => return,
            Hidden::Filled { .. } => {}
        }
        let is_filled = matches!(self.hidden, Hidden::Filled { .. });
        let mut active = [false; MAX_BINS];
        let mut reach = 0;
        for ((k, bin), active) in self.bins.iter_mut().enumerate().zip(&mut active) {
            let Some(bin) = bin else { continue };
            if !is_filled && k >= self.waits[block] {
                continue;
            }
            *active = is_filled
                || bin
                    .weight
                    .as_ref()
                    .is_none_or(|weight| self.tiles.any_within(weight, tile_columns.clone(), tile_rows.clone()));
            match *active {
                true => reach = reach.max(bin.scale as isize / 2),
                false => bin.clear(block),
            }
        }
        if !active.contains(&true) && !matches!(self.hidden, Hidden::Waits { .. }) {
            return;
        }
        let mut surfaces: Surfaces<WIDE> = Surfaces::new();
        let columns = columns_of(block, self.source.size.0);
        let height = self.source.size.1 as isize;
        let (first, end) = (self.rows.start as isize, self.rows.end as isize);
        let last = end.min((height as usize).next_multiple_of(CELL) as isize);
        for y in first - reach..last + reach {
            let inside = y.clamp(0, height - 1) as usize;
            let ahead = (y + AHEAD).clamp(0, height - 1) as usize;
            self.source.prefetch(ahead, (block * BLOCK) as isize - MARGIN as isize, columns + 2 * MARGIN);
            self.source.unpack::<V, WIDE>(
                inside,
                (block * BLOCK) as isize - MARGIN as isize,
                columns + 2 * MARGIN,
                &mut surfaces,
            );
            match &mut self.hidden {
                Hidden::Nothing => {}
                Hidden::Waits { halves, .. } => {
                    if (first..end.min(height)).contains(&y) {
                        halves.add(block * BLOCK, MARGIN..MARGIN + columns, y as usize, &surfaces);
                    }
                }
                Hidden::Filled { behind, .. } => {
                    let width = self.source.size.0;
                    behind.inpaint(simd, (block * BLOCK) as isize - MARGIN as isize, inside, width, &mut surfaces);
                }
            }
            let mut range = (f32::INFINITY, f32::NEG_INFINITY);
            widen(&mut range, &surfaces.back.0[3][..columns + 2 * MARGIN], |coc_px| coc_px);
            if surfaces.mixed {
                widen(&mut range, &surfaces.front.0[3][..columns + 2 * MARGIN], |coc_px| coc_px);
            }
            for ((bin, sums), _) in self.bins.iter_mut().zip(&mut self.sums.0).zip(active).filter(|(_, active)| *active)
            {
                let Some(bin) = bin else { continue };
                match bin.scale {
                    1 => bin.add::<V, 1>(simd, sums, (block, columns), first, y, &surfaces, range),
                    2 => bin.add::<V, 2>(simd, sums, (block, columns), first, y, &surfaces, range),
                    4 => bin.add::<V, 4>(simd, sums, (block, columns), first, y, &surfaces, range),
                    _ => bin.add::<V, 8>(simd, sums, (block, columns), first, y, &surfaces, range),
                }
            }
        }
    }
}

/// Returns the columns of a block inside the picture, rounded up to whole vectors of the coarsest bin.
fn columns_of(block: usize, width: usize) -> usize {
    (width - block * BLOCK).next_multiple_of(2 * TILE_W).min(BLOCK)
}
