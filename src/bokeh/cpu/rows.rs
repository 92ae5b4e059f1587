//! Buffers of the CPU executor: pictures as rows of planes, and a bin's result as strips.

use std::ops::Range;
use std::sync::atomic::AtomicBool;

use super::decimate::Decimated;
use super::tiles::BLOCK;
use crate::bokeh::plan::{Bin, CELL, Plan, SEGMENT};
use crate::compute::aligned::Aligned;
use crate::compute::simd::prefetch;

/// Rows of buffers are padded to a multiple of this number of values.
const ROW_PADDING: usize = 64;
/// Columns of a strip: the output of one part of the blur pass.
pub const STRIP: usize = 32;
/// Columns of a piece of a strip, which the pass `bin` fills or clears as a whole: cells, and a vector.
pub const PIECE: usize = 2 * CELL;

/// A picture of `CH` planes, row by row: `[row][plane][stride]`, each plane row with `pad` columns on both sides.
pub struct PlanarRows<const CH: usize> {
    pub data: Aligned,
    /// Values from one plane row to the next.
    pub stride: usize,
    /// Columns before the first pixel; at least this number also after the last.
    pub pad: usize,
}

impl<const CH: usize> PlanarRows<CH> {
    /// Allocates zeros, with padded rows.
    pub fn new(width: usize, height: usize, pad: usize) -> Self {
        let stride = width.next_multiple_of(ROW_PADDING) + 2 * pad;
        Self { data: Aligned::zeros(stride * CH * height), stride, pad }
    }

    /// Returns the number of values in a row, all planes together.
    pub fn row_len(&self) -> usize {
        self.stride * CH
    }

    /// Returns row `y`, all planes.
    #[inline(always)]
    pub fn row(&self, y: usize) -> &[f32] {
        &self.data[y * self.row_len()..][..self.row_len()]
    }
}

/// Repeats the outermost pixels of a plane row to both sides.
#[inline(always)]
pub fn repeat_edges(plane: &mut [f32], pad: usize, width: usize) {
    let (first, last) = (plane[pad], plane[pad + width - 1]);
    plane[..pad].fill(first);
    plane[pad + width..].fill(last);
}

/// The coarse grid of a bin: one value per cell of `CELL` x `CELL` bin pixels, row by row.
///
/// Planes: 0 coverage, 1 coverage times |CoC|, 2 to 4 lowest colour, 5 to 7 highest colour.
pub struct CellGrid {
    /// `[row][plane][width]`.
    pub data: Vec<f32>,
    pub width: usize,
    pub height: usize,
}

/// Lowest colour (and, negated, highest colour) of an empty cell.
pub const NO_COLOR: f32 = 1e30;
/// Planes of [`CellGrid`].
pub const CELL_PLANES: usize = 8;

/// Initial values of an empty cell.
pub const EMPTY_CELL: [f32; CELL_PLANES] = [0.0, 0.0, NO_COLOR, NO_COLOR, NO_COLOR, -NO_COLOR, -NO_COLOR, -NO_COLOR];

impl CellGrid {
    /// Creates an empty grid over `width` x `height` bin pixels (rows are padded).
    pub fn new(width: usize, height: usize) -> Self {
        let mut cells = Self { data: Vec::new(), width: 0, height: 0 };
        cells.reshape(width, height);
        cells
    }

    /// Empties the grid and resizes it.
    pub fn reshape(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width.next_multiple_of(ROW_PADDING) / CELL, height.div_ceil(CELL));
        self.data.clear();
        let planes = (0..self.height).flat_map(|_| EMPTY_CELL);
        planes.for_each(|value| self.data.extend(std::iter::repeat_n(value, self.width)));
    }

    /// Returns a plane of row `y`.
    #[inline(always)]
    pub fn plane(&self, y: usize, plane: usize) -> &[f32] {
        &self.data[(y * CELL_PLANES + plane) * self.width..][..self.width]
    }
}

/// Filter parameters at every segment edge, per row of cells: `[row][edge][EDGE_VALUES]`.
pub struct SegmentEdges {
    /// Radius in bin pixels, lowest colour (3), highest colour (3), unused.
    pub data: Vec<f32>,
    /// Edges across: one more than segments.
    pub across: usize,
    pub height: usize,
}

/// Values at an edge.
pub const EDGE_VALUES: usize = 8;
/// Edges of a strip.
pub const STRIP_EDGES: usize = STRIP / SEGMENT + 1;

impl SegmentEdges {
    /// Creates the edges of a grid of cells.
    pub fn new(cells: &CellGrid) -> Self {
        let mut edges = Self { data: Vec::new(), across: 0, height: 0 };
        edges.reshape(cells);
        edges
    }

    /// Resizes the edges; their content is unspecified afterwards.
    pub fn reshape(&mut self, cells: &CellGrid) {
        (self.across, self.height) = (cells.width * CELL / SEGMENT + 1, cells.height);
        self.data.resize(self.across * self.height * EDGE_VALUES, 0.0);
    }

    /// Returns the values at the edges of a strip in row `y` of the bin, linear between the middle rows of the cells.
    #[inline(always)]
    pub fn at(&self, strip: usize, y: usize) -> [[f32; EDGE_VALUES]; STRIP_EDGES] {
        let cell_y = (y as f32 - (CELL as f32 - 1.0) / 2.0) * (1.0 / CELL as f32);
        // Above the middle of the first row of cells, its values apply. A comparison, because `max` would also check
        // for NaN.
        let cell_y = if cell_y < 0.0 { 0.0 } else { cell_y };
        let above = (cell_y as usize).min(self.height - 1);
        let fraction = cell_y - above as f32;
        let below = (above + 1).min(self.height - 1);
        let row = |row: usize| {
            &self.data[(row * self.across + strip * (STRIP_EDGES - 1)) * EDGE_VALUES..][..STRIP_EDGES * EDGE_VALUES]
        };
        let (above, below) = (row(above), row(below));
        let mut values = [[0.0; EDGE_VALUES]; STRIP_EDGES];
        let flat = values.as_flattened_mut();
        for k in 0..STRIP_EDGES * EDGE_VALUES {
            flat[k] = above[k] + (below[k] - above[k]) * fraction;
        }
        values
    }
}

/// A bin's picture in strips, so that a filter down a strip reads memory sequentially:
/// `[row of cells][strip][CELL][4][STRIP]`, premultiplied colour and coverage.
pub struct Strips {
    pub data: Aligned,
    pub across: usize,
}

/// Columns that are copied at once.
pub const COPY_WIDTH: usize = 16;
/// Values of a row of a strip.
pub const STRIP_ROW: usize = 4 * STRIP;
/// Values of a strip in a row of cells.
pub const STRIP_CELLS: usize = CELL * STRIP_ROW;

/// Returns the columns beside a row that the filters of any level read, in whole pieces.
pub fn max_pad(plan: &Plan) -> usize {
    plan.ladder.max_half_width().next_multiple_of(COPY_WIDTH)
}

impl Strips {
    /// Returns row `y` of a strip: `[4][STRIP]`.
    #[inline(always)]
    pub fn row(&self, strip: usize, y: usize) -> &[f32] {
        &self.data[(y / CELL * self.across + strip) * STRIP_CELLS + y % CELL * STRIP_ROW..][..STRIP_ROW]
    }

    /// Prefetches the memory that [`Strips::copy_line`] reads.
    #[inline(always)]
    pub fn prefetch_line(&self, strip: usize, y: usize, pad: usize) {
        let first = (strip * STRIP).saturating_sub(pad);
        let end = ((strip + 1) * STRIP + pad).min(self.across * STRIP);
        for x in (first..end).step_by(COPY_WIDTH) {
            let row = self.row(x / STRIP, y);
            for p in 0..4 {
                prefetch(&row[p * STRIP + x % STRIP..][..COPY_WIDTH]);
            }
        }
    }

    /// Copies row `y` of a strip with `pad` columns on both sides (whole pieces) to `line`, `[4][STRIP + 2 pad]`.
    /// Outside the picture, which has `width` columns, the outermost ones repeat.
    #[inline(always)]
    pub fn copy_line(&self, strip: usize, y: usize, width: usize, pad: usize, line: &mut [f32]) {
        let span = STRIP + 2 * pad;
        for at in (0..span).step_by(COPY_WIDTH) {
            let x = (strip * STRIP + at) as isize - pad as isize;
            // A piece is inside one strip; past the picture's last column there may be strips without real columns.
            let inside = x.clamp(0, width as isize - 1) as usize;
            let row = self.row(inside / STRIP, y);
            for p in 0..4 {
                let out = &mut line[p * span + at..][..COPY_WIDTH];
                let plane = &row[p * STRIP..][..STRIP];
                if x >= 0 && x as usize / STRIP == inside / STRIP {
                    out.copy_from_slice(&plane[x as usize % STRIP..][..COPY_WIDTH]);
                } else {
                    out.fill(plane[inside % STRIP]);
                }
            }
        }
    }
}

/// Buffers of one bin: allocated for the largest bin of the slot, in the shape of the current one.
pub struct Slot {
    pub index: usize,
    /// Result of the pass `bin`.
    pub source: Strips,
    /// Its colours decimated, if the plan asks for it.
    pub decimated: Option<Decimated>,
    /// The coarse grid with the bin's coverage.
    pub cells: CellGrid,
    /// Per row of cells and block, whether `source` has any non-zero values.
    pub filled: Vec<bool>,
    /// Radius and colour range within the filter support.
    pub edges: SegmentEdges,
    /// The blurred bin, `[strip][row][4][STRIP]`: premultiplied colour and coverage.
    pub out: Aligned,
    /// Per strip and row of cells, whether `out` has any non-zero values.
    pub active: Vec<bool>,
    /// Whether the frame has content in this bin.
    pub present: bool,
    /// Flags for three [`DisjointParts`](crate::compute::thread_pool::DisjointParts) at once.
    pub taken: [Vec<AtomicBool>; 3],
    /// Scale of the bin whose shape it has; 0 before the first.
    scale: usize,
}

impl Slot {
    /// Returns the strips that contain these columns of the bin, clamped to the existing ones.
    #[inline(always)]
    pub fn strips(&self, columns: Range<usize>) -> Range<usize> {
        columns.start / STRIP..columns.end.div_ceil(STRIP).min(self.source.across)
    }

    /// Whether the result of a bin of this `height` has content in the row of cells of row `y` of a strip.
    #[inline(always)]
    pub fn is_active(&self, strip: usize, y: usize, height: usize) -> bool {
        self.active[strip * height.div_ceil(CELL) + y / CELL]
    }

    /// Allocates zeros for the largest bin of the slot; the system provides pages only as frames touch them.
    pub fn new(plan: &Plan, slot: usize) -> Self {
        let scale = plan.min_scale(slot);
        let (width, height) = (plan.width.div_ceil(scale), plan.height.div_ceil(scale));
        let strips = width.div_ceil(STRIP);
        let cells = CellGrid::new(width, height);
        let rows_of_cells = height.div_ceil(CELL);
        Self {
            index: slot,
            source: Strips { data: Aligned::zeros(strips * rows_of_cells * STRIP_CELLS), across: 0 },
            decimated: plan.privacy.then(|| Decimated::new(width, height, max_pad(plan))),
            filled: vec![false; plan.width.div_ceil(BLOCK) * rows_of_cells],
            edges: SegmentEdges::new(&cells),
            cells,
            out: Aligned::zeros(strips * height * 4 * STRIP),
            active: vec![false; strips * rows_of_cells],
            present: false,
            taken: std::array::from_fn(|_| {
                std::iter::repeat_with(|| AtomicBool::new(false)).take(strips.max(rows_of_cells)).collect()
            }),
            scale: 0,
        }
    }

    /// Takes the shape of a bin; if the scale changed, clears the used memory.
    pub fn reshape(&mut self, plan: &Plan, bin: &Bin) {
        if let Some(decimated) = &mut self.decimated {
            decimated.reshape(plan, bin);
        }
        if self.scale == bin.scale {
            return;
        }
        let old_rows = plan.height.div_ceil(self.scale.max(1));
        if self.scale > 0 {
            let used = self.source.across * old_rows.div_ceil(CELL) * STRIP_CELLS;
            self.source.data[..used].fill(0.0);
            self.out[..self.source.across * old_rows * STRIP_ROW].fill(0.0);
        }
        self.filled.fill(false);
        self.active.fill(false);
        self.scale = bin.scale;
        self.source.across = bin.width.div_ceil(STRIP);
        self.cells.reshape(bin.width, bin.height);
        self.edges.reshape(&self.cells);
    }

    /// Returns the number of values that the current shape uses: of `source`, and of `out`.
    pub fn used_len(&self, bin: &Bin) -> (usize, usize) {
        let across = self.source.across;
        (across * bin.height.div_ceil(CELL) * STRIP_CELLS, across * bin.height * STRIP_ROW)
    }
}
