//! Accumulators of the coarse grid over a bin: one row of cells, column by column.

#![allow(clippy::needless_range_loop)] // Planes index several arrays at once.

use pulp::Simd;

use super::rows::{CELL_PLANES, EMPTY_CELL, NO_COLOR};
use super::tent::PLANE_LEN;
use crate::bokeh::plan::MIN_COVERAGE;
use crate::compute::aligned::CacheAligned;
use crate::compute::simd::{load, store};

/// Partial sums of a row of cells, column by column.
pub type CellSums = CacheAligned<[[f32; PLANE_LEN]; CELL_PLANES]>;

/// Empties the cells.
#[inline(always)]
pub fn clear_cells(cells: &mut CellSums) {
    for (plane, &value) in cells.0.iter_mut().zip(&EMPTY_CELL) {
        plane.fill(value);
    }
}

/// Adds a vector of bin pixels to a row of cells, column by column: coverage, coverage times |CoC|, and with `own` the
/// lowest and highest colour.
#[inline(always)]
pub fn accumulate_columns<V: Simd>(
    simd: V,
    cells: &mut CellSums,
    x: usize,
    sums: [V::f32s; 2],
    own: Option<[V::f32s; 3]>,
) {
    for p in 0..2 {
        let sum = simd.add_f32s(load::<V>(&cells.0[p], x), sums[p]);
        store::<V>(&mut cells.0[p], x, sum);
    }
    let Some(own) = own else { return };
    let cells = &mut cells.0;
    // A pixel without coverage has no colour: an offset moves it out of range.
    let counts = simd.greater_than_f32s(sums[0], simd.splat_f32s(MIN_COVERAGE));
    let beyond = simd.select_f32s(counts, simd.splat_f32s(0.0), simd.splat_f32s(NO_COLOR));
    for p in 0..3 {
        let low = simd.min_f32s(load::<V>(&cells[2 + p], x), simd.add_f32s(own[p], beyond));
        let high = simd.max_f32s(load::<V>(&cells[5 + p], x), simd.sub_f32s(own[p], beyond));
        store::<V>(&mut cells[2 + p], x, low);
        store::<V>(&mut cells[5 + p], x, high);
    }
}
