//! The memory of the CPU executor: pictures as rows of planes, and a bin's result as strips.

use crate::bokeh::plan::{Bin, CELL, Plan};

/// Columns of a strip: what one part of the blur pass produces.
pub const STRIP: usize = 32;

/// A picture of `CH` planes, row by row: `[row][plane][stride]`, each plane row with `pad` columns on both sides.
#[derive(Default)]
pub struct Rows<const CH: usize> {
    /// The values.
    pub data: Vec<f32>,
    /// Values from one plane row to the next.
    pub stride: usize,
    /// Columns before the first pixel, and at least as many after the last.
    pub pad: usize,
}

impl<const CH: usize> Rows<CH> {
    /// Zeros, `width` rounded up to whole strips.
    pub fn new(width: usize, height: usize, pad: usize) -> Self {
        let stride = width.next_multiple_of(STRIP) + 2 * pad;
        Self { data: vec![0.0; stride * CH * height], stride, pad }
    }

    /// Values in a row, all planes together.
    pub fn row_len(&self) -> usize {
        self.stride * CH
    }

    /// Row `y`, all planes.
    #[inline(always)]
    pub fn row(&self, y: usize) -> &[f32] {
        &self.data[y * self.row_len()..][..self.row_len()]
    }
}

/// The coarse grid of a bin: one value per cell of `CELL` x `CELL` bin pixels, row by row.
///
/// Planes: 0 coverage, 1 coverage times |CoC|, 2 to 4 lowest colour, 5 to 7 highest colour.
pub struct Cells {
    /// `[row][plane][width]`.
    pub data: Vec<f32>,
    /// Cells across.
    pub width: usize,
    /// Cells down.
    pub height: usize,
}

/// Planes of [`Cells`].
pub const CELL_PLANES: usize = 8;

impl Cells {
    /// An empty grid over `width` x `height` bin pixels (`width` in whole strips).
    pub fn new(width: usize, height: usize) -> Self {
        let (width, height) = (width.next_multiple_of(STRIP) / CELL, height.div_ceil(CELL));
        Self { data: vec![0.0; width * height * CELL_PLANES], width, height }
    }

    /// A plane of row `y`.
    #[inline(always)]
    pub fn plane(&self, y: usize, plane: usize) -> &[f32] {
        &self.data[(y * CELL_PLANES + plane) * self.width..][..self.width]
    }
}

/// What one bin needs while a frame is blurred.
pub struct BinRows {
    /// Premultiplied colour, coverage, coverage times |CoC|.
    pub source: Rows<5>,
    /// The coarse grid as measured.
    pub cells: Cells,
    /// The coarse grid after `reach`: plane 1 is the radius in bin pixels, 2 to 7 the range of colours within reach.
    pub near_cells: Cells,
    /// The blurred bin, `[strip][row][4][STRIP]`: premultiplied colour and coverage.
    pub out: Vec<f32>,
    /// Per strip and row of cells, whether `out` holds anything but zeros.
    pub active: Vec<bool>,
    /// Strips across.
    pub strips: usize,
    /// Whether anything in the frame belongs to this bin.
    pub present: bool,
}

impl BinRows {
    /// Memory for one bin; pages that no frame touches are never really taken.
    pub fn new(plan: &Plan, bin: &Bin) -> Self {
        let strips = bin.width.div_ceil(STRIP);
        let cells = || Cells::new(bin.width, bin.height);
        Self {
            source: Rows::new(bin.width, bin.height, plan.reach().next_multiple_of(16)),
            cells: cells(),
            near_cells: cells(),
            out: vec![0.0; strips * bin.height * 4 * STRIP],
            active: vec![false; strips * bin.height.div_ceil(CELL)],
            strips,
            present: false,
        }
    }
}
