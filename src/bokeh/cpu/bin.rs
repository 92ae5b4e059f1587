//! One bin in the pass `bin`: adds rows of the picture to rows of the bin and its cells.
//!
//! twin: shaders/blur/bin.wgsl, shaders/blur/tent.wgsl

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use pulp::Simd;

use super::cell_sums::{CellSums, clear_cells};
use super::rows::CELL_PLANES;
use super::tent::{
    Means, PADDED_BLOCK, PLANE_LEN, SUM_PLANES, VectorWeight, accumulate_row, accumulate_whole_row, downscale_row,
};
use super::tiles::Run;
use super::unpack::Surfaces;
use crate::bokeh::plan::BinWeight;
use crate::compute::aligned::CacheAligned;

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
    pub(super) stale: bool,
    pub(super) cells: CellSums,
    pub(super) means: Means,
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

impl BinRows<'_> {
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
}
