//! What the parts of a pass that runs over every bin at once read and write, bin by bin.
#![allow(missing_docs)] // The fields are those of `BinRows`.

use super::rows::{BinRows, CELL_PLANES, Cells, Edges, Rows, STRIP};
use super::team::Shelf;
use crate::bokeh::plan::{Bin, CELL};

/// What the parts of the pass `bin` write for one bin.
pub struct BinShelves<'a> {
    pub source: Shelf<'a, f32>,
    pub cells: Shelf<'a, f32>,
    pub filled: Shelf<'a, bool>,
    pub stride: usize,
    pub pad: usize,
}

impl<'a> BinShelves<'a> {
    pub fn new(rows: &'a mut BinRows, across: usize) -> Self {
        let [first, second, third] = &mut rows.taken;
        let (stride, pad, row_len) = (rows.source.stride, rows.source.pad, rows.source.row_len());
        Self {
            source: Shelf::new(&mut rows.source.data, CELL * row_len, first),
            cells: Shelf::new(&mut rows.cells.data, CELL_PLANES * rows.cells.width, second),
            filled: Shelf::new(&mut rows.filled, across, third),
            stride,
            pad,
        }
    }
}

/// What the parts of the pass `blur` read and write for one bin.
pub struct StripShelves<'a> {
    /// The part that is its first strip.
    pub first: usize,
    pub source: &'a Rows<5>,
    pub cells: &'a Cells,
    pub edges: &'a Edges,
    pub out: Shelf<'a, f32>,
    pub active: Shelf<'a, bool>,
}

impl<'a> StripShelves<'a> {
    pub fn new(bin: &Bin, rows: &'a mut BinRows, first: usize) -> Self {
        let [taken, taken_too, _] = &mut rows.taken;
        Self {
            first,
            source: &rows.source,
            cells: &rows.cells,
            edges: &rows.edges,
            out: Shelf::new(&mut rows.out, bin.height * 4 * STRIP, taken),
            active: Shelf::new(&mut rows.active, bin.height.div_ceil(CELL), taken_too),
        }
    }
}
