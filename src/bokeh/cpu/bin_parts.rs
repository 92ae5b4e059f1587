//! Disjoint slices of the bins' buffers for passes whose parts run over every bin at once.
#![allow(missing_docs)] // The fields are those of `BinRows`.

use super::bin::BinRows;
use super::decimate::Decimated;
use super::rows::{CELL_PLANES, CellGrid, STRIP_CELLS, STRIP_ROW, SegmentEdges, Slot, Strips};
use super::tiles::BLOCK;
use crate::bokeh::ladder::Compositing;
use crate::bokeh::plan::{Bin, BinWeight, CELL, Plan};
use crate::compute::thread_pool::DisjointParts;

/// Output of the pass `bin` for one bin.
pub struct BinParts<'a> {
    source: DisjointParts<'a, f32>,
    cells: DisjointParts<'a, f32>,
    filled: DisjointParts<'a, bool>,
    weight: Option<BinWeight>,
    scale: usize,
    size: (usize, usize),
    needs_color_range: bool,
    is_steadied: bool,
    across: usize,
    /// Rows of the bin in a band.
    rows: usize,
}

impl<'a> BinParts<'a> {
    /// Splits the buffers of the `k`-th bin into bands of `rows` rows of the picture, in whole rows of cells.
    pub fn new(plan: &Plan, k: usize, slot: &'a mut Slot, rows: usize) -> Self {
        let bin = &plan.bins[k];
        let blocks = plan.width.div_ceil(BLOCK);
        let used = slot.used_len(bin).0;
        let [first, second, third] = &mut slot.taken;
        // Rows of the bin and of its cells in a band.
        let bin_rows = rows / bin.scale;
        let cells = bin_rows / CELL;
        Self {
            source: DisjointParts::new(&mut slot.source.data[..used], cells * slot.source.across * STRIP_CELLS, first),
            cells: DisjointParts::new(&mut slot.cells.data, cells * CELL_PLANES * slot.cells.width, second),
            filled: DisjointParts::new(&mut slot.filled[..blocks * bin.height.div_ceil(CELL)], cells * blocks, third),
            across: slot.source.across,
            rows: bin_rows,
            weight: (plan.compositing == Compositing::Layers).then(|| plan.bin_weight(k)),
            needs_color_range: plan.has_overshoot(bin),
            is_steadied: plan.is_steadied(bin),
            scale: bin.scale,
            size: (bin.width, bin.height),
        }
    }

    /// Returns the buffers of one band; each band can be taken once.
    pub fn part(&self, band: usize) -> BinRows<'_> {
        BinRows {
            weight: self.weight,
            scale: self.scale,
            size: self.size,
            needs_color_range: self.needs_color_range,
            is_steadied: self.is_steadied,
            out: self.source.part(band),
            across: self.across,
            rows: self.rows.min(self.size.1 - band * self.rows),
            cells: self.cells.part(band),
            filled: self.filled.part(band),
        }
    }
}

/// Input and output of the pass `blur` for one bin.
pub struct StripParts<'a> {
    /// Number of the part that does its first strip.
    pub first: usize,
    pub source: &'a Strips,
    /// Its colours decimated, if they are.
    pub decimated: Option<&'a Decimated>,
    pub cells: &'a CellGrid,
    pub edges: &'a SegmentEdges,
    pub out: DisjointParts<'a, f32>,
    pub active: DisjointParts<'a, bool>,
}

impl<'a> StripParts<'a> {
    /// Splits the buffers of a bin into strips; `first` is the part that does its first strip.
    pub fn new(bin: &Bin, slot: &'a mut Slot, first: usize) -> Self {
        let used = slot.used_len(bin).1;
        let down = bin.height.div_ceil(CELL);
        let [out_taken, active_taken, _] = &mut slot.taken;
        Self {
            first,
            source: &slot.source,
            decimated: slot.decimated.as_ref().filter(|decimated| decimated.is_in_use()),
            cells: &slot.cells,
            edges: &slot.edges,
            out: DisjointParts::new(&mut slot.out[..used], bin.height * STRIP_ROW, out_taken),
            active: DisjointParts::new(&mut slot.active[..slot.source.across * down], down, active_taken),
        }
    }
}
