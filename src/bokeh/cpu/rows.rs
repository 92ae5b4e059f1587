//! The memory of the CPU executor: pictures as rows of planes, and a bin's result as strips.

use std::sync::atomic::AtomicBool;

use super::aligned::Aligned;
use crate::bokeh::plan::{Bin, CELL, Plan, SEGMENT};

/// Columns of a strip: what one part of the blur pass produces.
pub const STRIP: usize = 32;

/// Pixels of the picture across a tile: what is converted at once, and has one range of CoC.
pub const TILE_W: usize = 64;
/// Rows of a tile.
pub const TILE_H: usize = 8;
/// Columns on both sides of the picture that repeat its outermost ones.
pub const MARGIN: usize = 16;

/// A picture of `CH` planes, row by row: `[row][plane][stride]`, each plane row with `pad` columns on both sides.
pub struct Rows<const CH: usize> {
    /// The values.
    pub data: Aligned,
    /// Values from one plane row to the next.
    pub stride: usize,
    /// Columns before the first pixel, and at least as many after the last.
    pub pad: usize,
}

impl<const CH: usize> Rows<CH> {
    /// Zeros, `width` rounded up to whole tiles.
    pub fn new(width: usize, height: usize, pad: usize) -> Self {
        let stride = width.next_multiple_of(TILE_W) + 2 * pad;
        Self { data: Aligned::zeros(stride * CH * height), stride, pad }
    }

    /// Values in a row, all planes together.
    pub fn row_len(&self) -> usize {
        self.stride * CH
    }

    /// Plane `p` of row `y`, from its first pixel on.
    #[inline(always)]
    pub fn plane(&self, y: usize, p: usize) -> &[f32] {
        &self.data[y * self.row_len() + p * self.stride + self.pad..][..self.stride - self.pad]
    }

    /// Row `y`, all planes.
    #[inline(always)]
    pub fn row(&self, y: usize) -> &[f32] {
        &self.data[y * self.row_len()..][..self.row_len()]
    }
}

/// Repeats the outermost pixels of a plane row to both sides.
#[inline(always)]
pub fn repeat_ends(plane: &mut [f32], pad: usize, width: usize) {
    let (first, last) = (plane[pad], plane[pad + width - 1]);
    plane[..pad].fill(first);
    plane[pad + width..].fill(last);
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

/// Lowest colour (and, negative, highest colour) of a cell without any.
pub const NO_COLOR: f32 = 1e30;
/// Planes of [`Cells`].
pub const CELL_PLANES: usize = 8;

impl Cells {
    /// An empty grid over `width` x `height` bin pixels (`width` in whole tiles).
    pub fn new(width: usize, height: usize) -> Self {
        let (width, height) = (width.next_multiple_of(TILE_W) / CELL, height.div_ceil(CELL));
        Self { data: vec![0.0; width * height * CELL_PLANES], width, height }
    }

    /// A plane of row `y`.
    #[inline(always)]
    pub fn plane(&self, y: usize, plane: usize) -> &[f32] {
        &self.data[(y * CELL_PLANES + plane) * self.width..][..self.width]
    }
}

/// What the filters need to know at every edge of a segment, per row of cells: `[row][edge][EDGE_VALUES]`.
pub struct Edges {
    /// Radius in bin pixels, lowest colour (3), highest colour (3), unused.
    pub data: Vec<f32>,
    /// Edges across: one more than there are segments.
    pub across: usize,
    /// Rows of cells.
    pub height: usize,
}

/// Values at an edge.
pub const EDGE_VALUES: usize = 8;
/// Edges of a strip.
pub const STRIP_EDGES: usize = STRIP / SEGMENT + 1;

impl Edges {
    /// Edges of a grid of cells.
    pub fn new(cells: &Cells) -> Self {
        let across = cells.width * CELL / SEGMENT + 1;
        Self { data: vec![0.0; across * cells.height * EDGE_VALUES], across, height: cells.height }
    }

    /// The values at the edges of a strip in row `y` of the bin, linear between the middles of the cells.
    #[inline(always)]
    pub fn at(&self, strip: usize, y: usize) -> [[f32; EDGE_VALUES]; STRIP_EDGES] {
        let along = (y as f32 - (CELL as f32 - 1.0) / 2.0) * (1.0 / CELL as f32);
        let along = if along < 0.0 { 0.0 } else { along };
        let above = (along as usize).min(self.height - 1);
        let share = along - above as f32;
        let below = (above + 1).min(self.height - 1);
        let row = |row: usize| {
            &self.data[(row * self.across + strip * (STRIP_EDGES - 1)) * EDGE_VALUES..][..STRIP_EDGES * EDGE_VALUES]
        };
        let (above, below) = (row(above), row(below));
        let mut values = [[0.0; EDGE_VALUES]; STRIP_EDGES];
        for (k, value) in values.as_flattened_mut().iter_mut().enumerate() {
            *value = above[k] + (below[k] - above[k]) * share;
        }
        values
    }
}

/// What one bin needs while a frame is blurred.
pub struct BinRows {
    /// Premultiplied colour, coverage, coverage times |CoC|.
    pub source: Rows<5>,
    /// The coarse grid as measured.
    pub cells: Cells,
    /// Per row of cells and tile, whether `source` holds anything but zeros.
    pub filled: Vec<bool>,
    /// The radius and the range of colours within reach.
    pub edges: Edges,
    /// The blurred bin, `[strip][row][4][STRIP]`: premultiplied colour and coverage.
    pub out: Aligned,
    /// Per strip and row of cells, whether `out` holds anything but zeros.
    pub active: Vec<bool>,
    /// Strips across.
    pub strips: usize,
    /// Whether anything in the frame belongs to this bin.
    pub present: bool,
    /// Flags for three shelves at once.
    pub taken: [Vec<AtomicBool>; 3],
}

impl BinRows {
    /// Memory for one bin; pages that no frame touches are never really taken.
    pub fn new(plan: &Plan, bin: &Bin) -> Self {
        let strips = bin.width.div_ceil(STRIP);
        let cells = Cells::new(bin.width, bin.height);
        Self {
            source: Rows::new(bin.width, bin.height, plan.reach().next_multiple_of(16)),
            filled: vec![false; plan.width.div_ceil(TILE_W) * cells.height],
            edges: Edges::new(&cells),
            cells,
            out: Aligned::zeros(strips * bin.height * 4 * STRIP),
            active: vec![false; strips * bin.height.div_ceil(CELL)],
            strips,
            present: false,
            taken: std::array::from_fn(|_| {
                let parts = strips.max(bin.height.div_ceil(CELL));
                std::iter::repeat_with(|| AtomicBool::new(false)).take(parts).collect()
            }),
        }
    }
}
