//! Stores finished rows of a bin, in strips, with the coarse grid over it.
//!
//! twin: shaders/blur/bin.wgsl

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use pulp::Simd;

use super::bin::{BinRows, BinSums};
use super::cell_sums::{CellSums, accumulate_columns, clear_cells};
use super::rows::{CELL_PLANES, EMPTY_CELL, PIECE, STRIP, STRIP_CELLS, STRIP_ROW};
use super::steady::steady;
use super::tent::{MARGIN, PADDED_BLOCK, SUM_PLANES, VectorWeight, is_zero};
use super::tiles::Run;
use super::unpack::Surfaces;
use crate::bokeh::plan::{CELL, MIN_COVERAGE};
use crate::compute::simd::{load, prefetch, store};

/// Rows between the row being stored and the row being prefetched, which is far away in memory.
const PREFETCH_ROWS: usize = 2;

impl BinRows<'_> {
    /// Removes all content of a run.
    #[inline(always)]
    pub fn clear(&mut self, run: Run) {
        let (x0, width) = (run.x0 / self.scale, run.columns / self.scale);
        for row in 0..self.cell_row_count() {
            let filled = self.filled_mut(row, run);
            let was_filled = *filled;
            *filled &= !run.is_whole;
            for row in (row * CELL..(row + 1) * CELL).filter(|_| was_filled) {
                self.clear_columns(x0, width, row);
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
        &mut self.out[(row / CELL * self.across + x / STRIP) * STRIP_CELLS + row % CELL * STRIP_ROW..][..STRIP_ROW]
    }

    /// Clears some columns of a row, in whole pieces.
    #[inline(always)]
    fn clear_columns(&mut self, x0: usize, width: usize, row: usize) {
        for x in (x0..(x0 + width).min(self.across * STRIP)).step_by(PIECE) {
            for plane in self.strip_row_mut(x, row).as_chunks_mut::<STRIP>().0 {
                plane[x % STRIP..][..PIECE].fill(0.0);
            }
        }
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

    /// Starts a row of cells if this is its first row.
    #[inline(always)]
    pub(super) fn begin_cell_row(&mut self, (run, row): (Run, usize), sums: &mut BinSums) {
        if row.is_multiple_of(CELL) {
            let filled = self.filled_mut(row / CELL, run);
            sums.stale = *filled;
            // The rest of the block keeps its content.
            *filled &= !run.is_whole;
        }
    }

    /// Clears a row without content in this bin.
    #[inline(always)]
    pub(super) fn clear_row<const S: usize>(&mut self, (run, row): (Run, usize), sums: &BinSums) {
        if sums.stale {
            self.clear_columns(run.x0 / S, run.columns / S, row);
        }
    }

    /// Stores a row of a bin at full scale, without averaging.
    #[inline(always)]
    pub(super) fn store_full_scale_row<V: Simd>(
        &mut self,
        simd: V,
        (run, row): (Run, usize),
        sums: &mut BinSums,
        surfaces: &Surfaces<PADDED_BLOCK>,
    ) {
        let weight = VectorWeight::new(simd, &self.weight);
        for x in (0..run.columns.min(self.across * STRIP - run.x0)).step_by(V::F32_LANES) {
            let taken = weight.surface_weights(simd, surfaces, MARGIN + x);
            let at = (run.x0 + x) % STRIP;
            let out = self.strip_row_mut(run.x0 + x, row);
            if is_zero(simd, taken) {
                if sums.stale {
                    for p in 0..4 {
                        store::<V>(out, p * STRIP + at, simd.splat_f32s(0.0));
                    }
                }
                continue;
            }
            let values = weight.apply(simd, taken, surfaces, MARGIN + x);
            // The strips of the next rows are far away in memory.
            let ahead = &self.strip_row_mut(run.x0 + x, (row + PREFETCH_ROWS).min(self.rows - 1))[at..];
            for p in 0..4 {
                prefetch(&ahead[p * STRIP..][..V::F32_LANES]);
            }
            let out = self.strip_row_mut(run.x0 + x, row);
            for p in 0..4 {
                store::<V>(out, p * STRIP + at, values[p]);
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
    pub(super) fn end_cell_row<const S: usize>(&mut self, (run, row): (Run, usize), sums: &mut BinSums) {
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
    pub(super) fn store_row<V: Simd, const S: usize>(&mut self, simd: V, (run, row): (Run, usize), sums: &mut BinSums) {
        let (x0, width) = (run.x0 / S, run.columns / S);
        let (floor, one) = (simd.splat_f32s(MIN_COVERAGE), simd.splat_f32s(1.0));
        let is_steadied = self.is_steadied;
        for x in (0..width.min(self.across * STRIP - x0)).step_by(V::F32_LANES) {
            let at = (x0 + x) % STRIP;
            let mut values = [one; SUM_PLANES];
            for p in 0..SUM_PLANES {
                values[p] = load::<V>(&sums.means.0[p], x);
            }
            let out = self.strip_row_mut(x0 + x, row);
            if is_steadied {
                steady(simd, out, at, &mut values);
            }
            for p in 0..4 {
                store::<V>(out, p * STRIP + at, values[p]);
            }
            let mut own = None;
            if self.needs_color_range {
                // Unpremultiplied; the floor avoids amplifying the colour of almost empty pixels.
                let inverse = simd.div_f32s(one, simd.max_f32s(values[3], floor));
                let mut colors = [inverse; 3];
                for p in 0..3 {
                    colors[p] = simd.mul_f32s(values[p], inverse);
                }
                own = Some(colors);
            }
            accumulate_columns(simd, &mut sums.cells, x, [values[3], values[4]], own);
            if at.is_multiple_of(PIECE) {
                let ahead = self.strip_row_mut(x0 + x, (row + 1).min(self.rows - 1));
                for p in 0..4 {
                    prefetch(&ahead[p * STRIP + at..][..PIECE]);
                }
            }
        }
        *self.filled_mut(row / CELL, run) = true;
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
