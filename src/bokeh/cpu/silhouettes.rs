//! Silhouettes (occlusion boundaries): the depth discontinuities, and how far from them the background is visible.
//!
//! A surface is opaque. Where the CoC changes by less than a pixel from pixel to pixel, a pixel shows only that one
//! surface through the aperture: a ray at CoC `c` is `|c|` away from the pixel, so nothing from behind appears farther
//! from a silhouette than the radius there. Each discontinuity marks this distance on a coarse grid; the marks are then
//! dilated.
//!
//! twin: shaders/blur/dilate_rows.wgsl, shaders/blur/dilate_columns.wgsl

#![allow(clippy::needless_range_loop)] // Lanes index two arrays at once.

use std::ops::Range;
use std::sync::atomic::AtomicBool;

use pulp::Arch;

use super::encode::CHUNK;
use crate::bokeh::occlusion::{DISTANCES_PER_CELL, SILHOUETTE_CELL};
use crate::compute::thread_pool::{DisjointParts, ThreadPool};

/// Distance without a silhouette.
pub const NO_SILHOUETTE: f32 = -1.0;
/// Rows of the grid per work item.
const ROWS_PER_ITEM: usize = 8;

/// The grid over a picture: `[row][DISTANCES_PER_CELL][across]`.
pub struct Silhouettes {
    /// Columns and rows of the grid.
    across: usize,
    down: usize,
    /// Radius of the silhouettes in a cell, in pixels; [`NO_SILHOUETTE`] without any.
    marks: Vec<f32>,
    /// After the dilation along rows: the maximum over silhouettes of radius^2 - distance^2.
    row_dilated: Vec<f32>,
    /// Maximum of each line of `row_dilated`, `[row][DISTANCES_PER_CELL]`.
    line_maxima: Vec<f32>,
    /// After the dilation along rows and columns: above 0 within the radius of a silhouette.
    dilated: Vec<f32>,
    taken: Vec<AtomicBool>,
}

impl Silhouettes {
    /// Allocates for pictures of `width` x `height` pixels.
    pub fn new(width: usize, height: usize) -> Self {
        let (across, down) = (width.div_ceil(SILHOUETTE_CELL), height.div_ceil(SILHOUETTE_CELL));
        let cells = vec![NO_SILHOUETTE; across * DISTANCES_PER_CELL * down];
        let taken = std::iter::repeat_with(|| AtomicBool::new(false)).take(down).collect();
        let line_maxima = vec![NO_SILHOUETTE; DISTANCES_PER_CELL * down];
        Self { across, down, marks: cells.clone(), row_dilated: cells.clone(), line_maxima, dilated: cells, taken }
    }

    /// Returns the marks, to be written in parts of `rows` rows of the picture, whole rows of the grid.
    pub fn marks(&mut self, rows: usize) -> DisjointParts<'_, f32> {
        DisjointParts::new(&mut self.marks, rows / SILHOUETTE_CELL * DISTANCES_PER_CELL * self.across, &mut self.taken)
    }

    /// Dilates the marks by their radii, along the rows and then down the columns.
    pub fn dilate(&mut self, workers: &mut ThreadPool, arch: Arch) {
        let (across, row_len, down) = (self.across, self.across * DISTANCES_PER_CELL, self.down);
        let marks = &self.marks;
        let parts = DisjointParts::new(&mut self.row_dilated, ROWS_PER_ITEM * row_len, &mut self.taken);
        workers.run(down.div_ceil(ROWS_PER_ITEM), &|part| {
            let rows = parts.part(part);
            let marks = &marks[part * ROWS_PER_ITEM * row_len..][..rows.len()];
            arch.dispatch(|| {
                for (out, marks) in rows.chunks_exact_mut(across).zip(marks.chunks_exact(across)) {
                    dilate_row(marks, out);
                }
            });
        });
        arch.dispatch(|| {
            for (top, line) in self.line_maxima.iter_mut().zip(self.row_dilated.chunks_exact(across)) {
                *top = maximum(line);
            }
        });
        let (row_dilated, line_maxima) = (&self.row_dilated, &self.line_maxima);
        let radius = radius_in_cells(maximum(line_maxima));
        let parts = DisjointParts::new(&mut self.dilated, ROWS_PER_ITEM * row_len, &mut self.taken);
        workers.run(down.div_ceil(ROWS_PER_ITEM), &|part| {
            let rows = parts.part(part);
            arch.dispatch(|| {
                for (line, out) in (part * ROWS_PER_ITEM * DISTANCES_PER_CELL..).zip(rows.chunks_exact_mut(across)) {
                    let (y, plane) = (line / DISTANCES_PER_CELL, line % DISTANCES_PER_CELL);
                    out.fill(NO_SILHOUETTE);
                    for other in y.saturating_sub(radius)..(y + radius + 1).min(down) {
                        let (from, distance_px) =
                            (other * DISTANCES_PER_CELL + plane, (other.abs_diff(y) * SILHOUETTE_CELL) as f32);
                        let distance_square = distance_px * distance_px;
                        // Most lines have no silhouette, or none with a radius that large.
                        if line_maxima[from] - distance_square > NO_SILHOUETTE {
                            assign_max_offset(out, &row_dilated[from * across..][..across], distance_square);
                        }
                    }
                }
            });
        });
    }

    /// Whether any pixel of some columns and rows may be within the radius of a silhouette. If not,
    /// [`Self::proximity`] is `None` in all of them.
    #[inline(always)]
    pub fn may_be_near(&self, columns: Range<usize>, rows: Range<usize>) -> bool {
        let mut rows =
            (rows.start / SILHOUETTE_CELL).saturating_sub(1)..(rows.end.div_ceil(SILHOUETTE_CELL) + 1).min(self.down);
        let columns =
            (columns.start / SILHOUETTE_CELL).saturating_sub(1)..(columns.end / SILHOUETTE_CELL + 1).min(self.across);
        rows.any(|row| {
            let line = &self.dilated[row * DISTANCES_PER_CELL * self.across..][..self.across];
            line[columns.clone()].iter().any(|&square| square > 0.0)
        })
    }

    /// Returns radius^2 - distance^2 of silhouettes for a chunk of row `y` from column `x0` on, a multiple of the
    /// grain: for any silhouette, and for those whose background is not in front. Returns `None` if all are outside.
    #[inline(always)]
    pub fn proximity(&self, y: usize, x0: usize) -> Option<Proximity> {
        let along = ((y as f32 + 0.5) / SILHOUETTE_CELL as f32 - 0.5).max(0.0);
        let above = (along as usize).min(self.down - 1);
        let below = (above + 1).min(self.down - 1);
        let mut proximity = Proximity([[0.0; CHUNK_CELLS]; 2]);
        for (plane, line) in proximity.0.iter_mut().enumerate() {
            let row = |row: usize| &self.dilated[(row * DISTANCES_PER_CELL + plane) * self.across..][..self.across];
            let (above, below, first) = (row(above), row(below), x0 / SILHOUETTE_CELL);
            if first > 0 && first + CHUNK_CELLS <= self.across {
                let (above, below) = (&above[first - 1..][..CHUNK_CELLS], &below[first - 1..][..CHUNK_CELLS]);
                for k in 0..CHUNK_CELLS {
                    line[k] = above[k] + along.fract() * (below[k] - above[k]);
                }
            } else {
                for (k, value) in line.iter_mut().enumerate() {
                    let x = (first + k).saturating_sub(1).min(self.across - 1);
                    *value = above[x] + along.fract() * (below[x] - above[x]);
                }
            }
        }
        (maximum(&proximity.0[0]) > 0.0).then_some(proximity)
    }

    /// Returns the cells of row `y` of the picture: above 0 where the background past a silhouette is visible, and
    /// where the background that it hides matters.
    #[inline(always)]
    pub fn row(&self, y: usize) -> [&[f32]; 2] {
        [0, DISTANCES_PER_CELL - 1].map(|plane| {
            &self.dilated[(y / SILHOUETTE_CELL * DISTANCES_PER_CELL + plane) * self.across..][..self.across]
        })
    }
}

/// Cells of a chunk, plus one on both sides.
const CHUNK_CELLS: usize = CHUNK / SILHOUETTE_CELL + 2;
/// Lanes of the widest vector.
const MAX_LANES: usize = 16;

/// The maximum of radius^2 - distance^2, by the cells of a chunk: see [`Silhouettes::proximity`].
pub struct Proximity([[f32; CHUNK_CELLS]; 2]);

impl Proximity {
    /// Returns the values of some pixels from column `x` of the chunk on, linear between the centres of cells; `None`
    /// if all are outside.
    #[inline(always)]
    pub fn interpolate(&self, x: usize, count: usize) -> Option<[[f32; MAX_LANES]; 2]> {
        let cells = &self.0[0][x / SILHOUETTE_CELL..][..count / SILHOUETTE_CELL + 2];
        if cells.iter().all(|&square| square <= 0.0) {
            return None;
        }
        let mut pixels = [[0.0; MAX_LANES]; 2];
        for (pixels, line) in pixels.iter_mut().zip(&self.0) {
            let line = &line[x / SILHOUETTE_CELL..];
            for (k, group) in pixels[..count].as_chunks_mut::<SILHOUETTE_CELL>().0.iter_mut().enumerate() {
                let (before, here, after) = (line[k], line[k + 1], line[k + 2]);
                for (i, value) in group.iter_mut().enumerate() {
                    let offset = (i as f32 + 0.5) / SILHOUETTE_CELL as f32 - 0.5;
                    *value = here + (if offset < 0.0 { before } else { after } - here) * offset.abs();
                }
            }
        }
        Some(pixels)
    }
}

/// Returns the maximum.
#[inline(always)]
pub fn maximum(values: &[f32]) -> f32 {
    let mut highest = [f32::MIN; 16];
    let (vectors, rest) = values.as_chunks::<16>();
    for values in vectors {
        for k in 0..16 {
            highest[k] = if values[k] > highest[k] { values[k] } else { highest[k] };
        }
    }
    rest.iter().copied().chain(highest).fold(f32::MIN, f32::max)
}

/// Returns the radius in cells for a squared radius in pixels, rounded up.
fn radius_in_cells(square: f32) -> usize {
    if square < 0.0 { 0 } else { square.sqrt() as usize / SILHOUETTE_CELL + 1 }
}

/// Dilates the marks of a row along it, one by one: there are few.
#[inline(always)]
fn dilate_row(marks: &[f32], out: &mut [f32]) {
    out.fill(NO_SILHOUETTE);
    for (x, &px) in marks.iter().enumerate().filter(|&(_, &px)| px > 0.0) {
        let radius = radius_in_cells(px * px);
        let first = x.saturating_sub(radius);
        for (to, out) in (first..).zip(&mut out[first..(x + radius + 1).min(marks.len())]) {
            let distance_px = (to.abs_diff(x) * SILHOUETTE_CELL) as f32;
            let square = if px > distance_px { px * px - distance_px * distance_px } else { NO_SILHOUETTE };
            *out = if square > *out { square } else { *out };
        }
    }
}

#[inline(always)]
fn assign_max_offset(out: &mut [f32], along: &[f32], distance_square: f32) {
    for (out, &square) in out.iter_mut().zip(along) {
        let left = square - distance_square;
        *out = if left > *out { left } else { *out };
    }
}
