//! One bin in the pass `bin`: adds rows of the picture to rows of the bin and its cells.
//!
//! twin: shaders/blur/bin.wgsl, shaders/blur/tent.wgsl

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use pulp::Simd;

use super::cell_sums::{CellSums, accumulate_columns, clear_cells};
use super::rows::{CELL_PLANES, EMPTY_CELL, STRIP, STRIP_CELLS, STRIP_ROW};
use super::steady::steady;
use super::tent::{
    MARGIN, Means, PADDED_BLOCK, PLANE_LEN, SUM_PLANES, VectorWeight, accumulate_row, accumulate_whole_row,
    downscale_row, is_zero,
};
use super::tiles::Run;
use super::unpack::Surfaces;
use crate::bokeh::plan::{BinWeight, CELL, MIN_COVERAGE};
use crate::compute::aligned::CacheAligned;
use crate::compute::simd::{load, prefetch, store};

/// How the pixels of a row count in a bin.
#[derive(Clone, Copy)]
pub enum Row {
    /// All as a whole; with their radius, in pixels, if it is the same for all. Only in bins at a reduced scale.
    Whole(Option<f32>),
    /// By their weights; with the range of their CoC, in pixels.
    Weighted((f32, f32)),
}

/// Output of one bin for a band.
pub struct BinRows<'a> {
    /// Weight of a pixel in the bin; `None` is 1 everywhere (no depth discontinuities).
    pub weight: Option<BinWeight>,
    /// Pixels of the picture per bin pixel and axis.
    pub scale: usize,
    /// Columns and rows of the bin.
    pub size: (usize, usize),
    /// Whether the range of its colours is needed.
    pub needs_color_range: bool,
    /// Whether what changes little moves slowly from frame to frame.
    pub is_steadied: bool,
    /// Rows of the bin in this band.
    pub rows: usize,
    /// Strips of the band, laid out like [`Strips`](super::rows::Strips).
    pub out: &'a mut [f32],
    /// Strips across.
    pub across: usize,
    /// `[row of cells][CELL_PLANES][across]`.
    pub cells: &'a mut [f32],
    /// Per block, whether `out` has any non-zero values.
    pub filled: &'a mut [bool],
}

/// Sums of a bin: the two bin rows in progress, the last finished row, and the row of cells.
#[derive(Clone)]
pub struct BinSums {
    rows: CacheAligned<[[[f32; PADDED_BLOCK]; SUM_PLANES]; 2]>,
    /// Whether each of the two rows has been started.
    touched: [bool; 2],
    /// Whether the bin has data of the previous frame at the row of cells.
    stale: bool,
    cells: CellSums,
    means: Means,
}

impl BinSums {
    pub fn new() -> Self {
        let mut empty = Self {
            rows: CacheAligned([[[0.0; PADDED_BLOCK]; SUM_PLANES]; 2]),
            touched: [false; 2],
            stale: false,
            cells: CacheAligned([[0.0; PLANE_LEN]; CELL_PLANES]),
            means: CacheAligned([[0.0; PLANE_LEN]; SUM_PLANES]),
        };
        clear_cells(&mut empty.cells);
        empty
    }
}

/// Rows between the row being stored and the row being prefetched, which is far away in memory.
const PREFETCH_ROWS: usize = 2;

/// Returns the offset of row `row` of the strip at column `x`.
#[inline(always)]
fn strip_row_offset(across: usize, x: usize, row: usize) -> usize {
    (row / CELL * across + x / STRIP) * STRIP_CELLS + row % CELL * STRIP_ROW
}

impl BinRows<'_> {
    /// Removes all content of a run.
    #[inline(always)]
    pub fn clear(&mut self, run: Run) {
        let (x0, width) = (run.x0 / self.scale, run.columns / self.scale);
        for row in 0..self.cell_row_count() {
            let filled = self.filled_mut(row, run);
            let was_filled = *filled;
            *filled &= !run.is_whole;
            if was_filled {
                let first = row * self.across + x0 / STRIP;
                let count = width.div_ceil(STRIP).min(self.across - x0 / STRIP);
                self.out[first * STRIP_CELLS..][..count * STRIP_CELLS].fill(0.0);
            }
        }
        let across = self.size.0.div_ceil(CELL);
        let (first, cells) = (x0 / CELL, width.div_ceil(CELL).min(across.saturating_sub(x0 / CELL)));
        let total = self.cells.len() / (CELL_PLANES * self.cell_row_count());
        for (k, plane) in self.cells.chunks_exact_mut(total).enumerate() {
            plane[first..first + cells].fill(EMPTY_CELL[k % CELL_PLANES]);
        }
    }

    /// Returns row `row` of the strip at column `x`.
    #[inline(always)]
    fn strip_row_mut(&mut self, x: usize, row: usize) -> &mut [f32] {
        &mut self.out[strip_row_offset(self.across, x, row)..][..STRIP_ROW]
    }

    /// Repeats the last column up to the end of the last strip.
    pub fn repeat_last_column(&mut self) {
        let last = (self.size.0 - 1) % STRIP;
        for row in 0..self.rows {
            for plane in self.strip_row_mut(self.size.0 - 1, row).as_chunks_mut::<STRIP>().0 {
                let value = plane[last];
                plane[last + 1..].fill(value);
            }
        }
    }

    /// Returns whether the row of cells has any content in the block of a run.
    fn filled_mut(&mut self, row_of_cells: usize, run: Run) -> &mut bool {
        let blocks = self.filled.len() / self.cell_row_count();
        &mut self.filled[row_of_cells * blocks + run.block]
    }

    fn cell_row_count(&self) -> usize {
        self.rows.div_ceil(CELL)
    }

    /// Adds row `y` of a band (may be outside it) to the bin rows that it contributes to: as a whole, or by its weights.
    #[inline(always)]
    pub fn add_row<V: Simd, const S: usize>(
        &mut self,
        simd: V,
        sums: &mut BinSums,
        (run, y): (Run, isize),
        surfaces: &Surfaces<PADDED_BLOCK>,
        row: Row,
    ) {
        let rows = self.rows as isize;
        let overlaps = match row {
            Row::Whole(_) => true,
            Row::Weighted(range) => self.weight.is_none_or(|weight| weight.overlaps(range)),
        };
        if S == 1 {
            if (0..rows).contains(&y) {
                let row = (run, y as usize);
                self.begin_cell_row(row, sums);
                match overlaps {
                    true => self.store_full_scale_row(simd, row, sums, surfaces),
                    false => self.clear_row::<S>(row, sums),
                }
                self.end_cell_row::<S>(row, sums);
            }
            return;
        }
        // For the bin row above, this is row `k + S` of its tent; for the row below, row `k`.
        let s = S as isize;
        let from = y + s / 2;
        let (lower, k) = (from.div_euclid(s), from.rem_euclid(s));
        let upper = lower - 1;
        if from < 0 || upper >= rows {
            return;
        }
        // Both bin rows in progress alternate between the buffers.
        let parity = upper.rem_euclid(2) as usize;
        let [even, odd] = &mut sums.rows.0;
        let (above, below) = if parity == 0 { (even, odd) } else { (odd, even) };
        if overlaps {
            let fresh = [!sums.touched[parity], !sums.touched[1 - parity]];
            sums.touched = [true; 2];
            let rise = (k as f32 + 0.5) / (S * S) as f32;
            let weights = [1.0 / S as f32 - rise, rise];
            match row {
                Row::Whole(radius_px) => {
                    // Colours, and radii unless they are all the same.
                    for (p, sum) in
                        [0, 1, 2, 3].into_iter().zip([0, 1, 2, 4]).take(3 + usize::from(radius_px.is_none()))
                    {
                        let (values, rows) = (&surfaces.back.0[p], [&mut above[sum], &mut below[sum]]);
                        accumulate_whole_row(simd, values, run.columns, weights, rows, fresh);
                    }
                }
                Row::Weighted(_) => {
                    let weight = VectorWeight::new(simd, &self.weight);
                    accumulate_row(simd, &weight, surfaces, run.columns, weights, [above, below], fresh);
                }
            }
        }
        if k == s - 1 {
            let touched = std::mem::take(&mut sums.touched[parity]);
            if upper == rows - 1 {
                sums.touched[1 - parity] = false;
            }
            if upper >= 0 {
                self.finish_row::<V, S>(simd, sums, (run, upper as usize), touched.then_some(row));
            }
        }
    }

    /// Downscales and stores a bin row whose tent is complete, or clears it if it is empty.
    #[inline(always)]
    fn finish_row<V: Simd, const S: usize>(&mut self, simd: V, sums: &mut BinSums, at: (Run, usize), row: Option<Row>) {
        self.begin_cell_row(at, sums);
        if let Some(row) = row {
            let above = &sums.rows.0[at.1 % 2];
            for p in 0..SUM_PLANES {
                let mean = &mut sums.means.0[p];
                match (row, p) {
                    (Row::Whole(_), 3) => mean.fill(1.0),
                    (Row::Whole(Some(radius_px)), 4) => mean.fill(radius_px.abs()),
                    _ => downscale_row::<V, S>(simd, &above[p], at.0.columns, mean),
                }
            }
            if matches!(row, Row::Whole(None)) {
                // A bin is on one side of the focal plane: all its CoC have the same sign.
                sums.means.0[4].iter_mut().for_each(|radius_px| *radius_px = radius_px.abs());
            }
            self.store_row::<V, S>(simd, at, sums);
        } else {
            self.clear_row::<S>(at, sums);
        }
        self.end_cell_row::<S>(at, sums);
    }

    /// Starts a row of cells if this is its first row.
    #[inline(always)]
    fn begin_cell_row(&mut self, (run, row): (Run, usize), sums: &mut BinSums) {
        if row.is_multiple_of(CELL) {
            let filled = self.filled_mut(row / CELL, run);
            sums.stale = *filled;
            // The rest of the block keeps its content.
            *filled &= !run.is_whole;
        }
    }

    /// Clears a row without content in this bin.
    #[inline(always)]
    fn clear_row<const S: usize>(&mut self, (run, row): (Run, usize), sums: &BinSums) {
        let x0 = run.x0 / S;
        if sums.stale {
            for x in (0..(run.columns / S).min(self.across * STRIP - x0)).step_by(STRIP) {
                self.strip_row_mut(x0 + x, row).fill(0.0);
            }
        }
    }

    /// Stores a row of a bin at full scale, without averaging.
    #[inline(always)]
    fn store_full_scale_row<V: Simd>(
        &mut self,
        simd: V,
        (run, row): (Run, usize),
        sums: &mut BinSums,
        surfaces: &Surfaces<PADDED_BLOCK>,
    ) {
        let weight = VectorWeight::new(simd, &self.weight);
        for x in (0..run.columns.min(self.across * STRIP - run.x0)).step_by(V::F32_LANES) {
            let taken = weight.surface_weights(simd, surfaces, MARGIN + x);
            let out = self.strip_row_mut(run.x0 + x, row);
            if is_zero(simd, taken) {
                if sums.stale {
                    for p in 0..4 {
                        store::<V>(out, p * STRIP + x % STRIP, simd.splat_f32s(0.0));
                    }
                }
                continue;
            }
            let values = weight.apply(simd, taken, surfaces, MARGIN + x);
            // The strips of the next rows are far away in memory.
            let ahead = &self.strip_row_mut(run.x0 + x, (row + PREFETCH_ROWS).min(self.rows - 1))[x % STRIP..];
            for p in 0..4 {
                prefetch(&ahead[p * STRIP..][..V::F32_LANES]);
            }
            let out = self.strip_row_mut(run.x0 + x, row);
            for p in 0..4 {
                store::<V>(out, p * STRIP + x % STRIP, values[p]);
            }
            // At full scale a pixel is its own mean: its colour counts whatever its weight. For two surfaces it is the
            // colour of their weighted sum.
            let mut own = None;
            if self.needs_color_range {
                let mut colors = [values[0], values[1], values[2]];
                if surfaces.mixed {
                    let floor = simd.splat_f32s(MIN_COVERAGE);
                    let inverse = simd.div_f32s(simd.splat_f32s(1.0), simd.max_f32s(values[3], floor));
                    for p in 0..3 {
                        colors[p] = simd.mul_f32s(values[p], inverse);
                    }
                } else {
                    for p in 0..3 {
                        colors[p] = load::<V>(&surfaces.back.0[p], MARGIN + x);
                    }
                }
                own = Some(colors);
            }
            accumulate_columns(simd, &mut sums.cells, x, [values[3], values[4]], own);
        }
        *self.filled_mut(row / CELL, run) = true;
    }

    /// Stores the row of cells after its last row.
    #[inline(always)]
    fn end_cell_row<const S: usize>(&mut self, (run, row): (Run, usize), sums: &mut BinSums) {
        if row % CELL == CELL - 1 || row == self.rows - 1 {
            let filled = *self.filled_mut(row / CELL, run);
            self.store_cells::<S>(run, row / CELL, filled.then_some(&sums.cells));
            if filled {
                clear_cells(&mut sums.cells);
            }
        }
    }

    /// Stores a row of the bin and adds it to its cells.
    #[inline(always)]
    fn store_row<V: Simd, const S: usize>(&mut self, simd: V, (run, row): (Run, usize), sums: &mut BinSums) {
        let (x0, width) = (run.x0 / S, run.columns / S);
        let means = &mut sums.means.0;
        for x in (0..width.min(self.across * STRIP - x0)).step_by(STRIP) {
            if self.is_steadied {
                let last = &self.out[strip_row_offset(self.across, x0 + x, row)..][..STRIP_ROW];
                for k in (0..STRIP).step_by(V::F32_LANES) {
                    steady(simd, (last, k, STRIP), &mut means[..4], x + k);
                }
            }
            let out = &mut self.out[strip_row_offset(self.across, x0 + x, row)..][..STRIP_ROW];
            for p in 0..4 {
                out[p * STRIP..][..STRIP].copy_from_slice(&means[p][x..x + STRIP]);
            }
            prefetch(self.strip_row_mut(x0 + x, (row + 1).min(self.rows - 1)));
        }
        *self.filled_mut(row / CELL, run) = true;
        let (floor, one) = (simd.splat_f32s(MIN_COVERAGE), simd.splat_f32s(1.0));
        for x in (0..width).step_by(V::F32_LANES) {
            let coverage = load::<V>(&means[3], x);
            let mut own = None;
            if self.needs_color_range {
                // Unpremultiplied; the floor avoids amplifying the colour of almost empty pixels.
                let inverse = simd.div_f32s(one, simd.max_f32s(coverage, floor));
                let mut colors = [inverse; 3];
                for p in 0..3 {
                    colors[p] = simd.mul_f32s(load::<V>(&means[p], x), inverse);
                }
                own = Some(colors);
            }
            accumulate_columns(simd, &mut sums.cells, x, [coverage, load::<V>(&means[4], x)], own);
        }
    }

    #[inline(always)]
    fn store_cells<const S: usize>(&mut self, run: Run, row: usize, cells: Option<&CellSums>) {
        let across = self.cells.len() / (CELL_PLANES * self.cell_row_count());
        let (x0, width) = (run.x0 / S, run.columns / S);
        let valid = width.min(self.size.0.saturating_sub(x0));
        for p in 0..if self.needs_color_range { CELL_PLANES } else { 2 } {
            let out = &mut self.cells[(row * CELL_PLANES + p) * across + x0 / CELL..];
            let Some(cells) = cells else {
                out[..valid.div_ceil(CELL)].fill(EMPTY_CELL[p]);
                continue;
            };
            let values = &cells.0[p];
            for (out, values) in out.iter_mut().zip(values[..valid].chunks(CELL)) {
                let mut total = EMPTY_CELL[p];
                for &value in values {
                    total = match p {
                        0 | 1 => total + value,
                        2..5 => total.min(value),
                        _ => total.max(value),
                    };
                }
                *out = total;
            }
        }
    }
}
