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

use pulp::{Arch, Simd, WithSimd};

use super::encode::CHUNK;
use crate::bokeh::occlusion::{DISTANCES_PER_CELL, SILHOUETTE_CELL};
use crate::compute::simd::{load, store};
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
    /// Of `row_dilated`, `[row][DISTANCES_PER_CELL]`.
    lines: Vec<Line>,
    /// After the dilation along rows and columns: above 0 within the radius of a silhouette.
    dilated: Vec<f32>,
    taken: [Vec<AtomicBool>; 3],
}

/// What a line of `row_dilated` holds.
#[derive(Clone)]
struct Line {
    /// Maximum of radius^2; [`NO_SILHOUETTE`] if the line has no silhouette and is not written.
    top: f32,
    /// Cells within the radius of a silhouette.
    cells: Range<usize>,
}

impl Silhouettes {
    /// Allocates for pictures of `width` x `height` pixels.
    pub fn new(width: usize, height: usize) -> Self {
        let (across, down) = (width.div_ceil(SILHOUETTE_CELL), height.div_ceil(SILHOUETTE_CELL));
        let cells = vec![NO_SILHOUETTE; across * DISTANCES_PER_CELL * down];
        let taken = [(); 3].map(|()| std::iter::repeat_with(|| AtomicBool::new(false)).take(down).collect());
        let lines = vec![Line { top: NO_SILHOUETTE, cells: 0..0 }; DISTANCES_PER_CELL * down];
        Self { across, down, marks: cells.clone(), row_dilated: cells.clone(), lines, dilated: cells, taken }
    }

    /// Returns the marks, to be written in parts of `rows` rows of the picture, whole rows of the grid.
    pub fn marks(&mut self, rows: usize) -> DisjointParts<'_, f32> {
        let len = rows / SILHOUETTE_CELL * DISTANCES_PER_CELL * self.across;
        DisjointParts::new(&mut self.marks, len, &mut self.taken[0])
    }

    /// Dilates the marks by their radii, along the rows and then down the columns; only the first `planes` distances.
    pub fn dilate(&mut self, planes: usize, workers: &mut ThreadPool, arch: Arch) {
        let (across, down) = (self.across, self.down);
        let lines_per_item = ROWS_PER_ITEM * DISTANCES_PER_CELL;
        let marks = &self.marks;
        let [taken, taken_lines, taken_scratch] = &mut self.taken;
        let row_dilated = DisjointParts::new(&mut self.row_dilated, lines_per_item * across, taken);
        let lines = DisjointParts::new(&mut self.lines, lines_per_item, taken_lines);
        // The result is written last, so its memory is free: at least one row of it.
        let scratch = DisjointParts::new(&mut self.dilated, lines_per_item * across, taken_scratch);
        workers.run(down.div_ceil(ROWS_PER_ITEM), &|part| {
            let (out, lines, padded) = (row_dilated.part(part), lines.part(part), scratch.part(part));
            let marks = &marks[part * lines_per_item * across..][..out.len()];
            arch.dispatch(DilateRows { marks, planes, padded, lines, out });
        });
        let (row_dilated, lines) = (&self.row_dilated, &self.lines);
        let radius = radius_in_cells(lines.iter().fold(0.0, |top, line| line.top.max(top)));
        let parts = DisjointParts::new(&mut self.dilated, lines_per_item * across, taken);
        workers.run(down.div_ceil(ROWS_PER_ITEM), &|part| {
            let (out, first) = (parts.part(part), part * lines_per_item);
            arch.dispatch(DilateColumns { row_dilated, lines, planes, radius, first, out });
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
            maximum(&line[columns.clone()]) > 0.0
        })
    }

    /// Returns radius^2 - distance^2 of silhouettes for a chunk of row `y` from column `x0` on, a multiple of the
    /// grain: for any silhouette, and for those whose background is not in front. Returns `None` if all are outside.
    #[inline(always)]
    pub fn proximity(&self, y: usize, x0: usize) -> Option<Proximity> {
        let along = ((y as f32 + 0.5) / SILHOUETTE_CELL as f32 - 0.5).max(0.0);
        let above = (along as usize).min(self.down - 1);
        let below = (above + 1).min(self.down - 1);
        let (first, before) = (x0 / SILHOUETTE_CELL, usize::from(x0 == 0));
        let cells = first + before - 1..(first + CHUNK_CELLS - 1).min(self.across);
        let mut proximity = Proximity([[0.0; CHUNK_CELLS]; 2]);
        for (plane, line) in proximity.0.iter_mut().enumerate() {
            let row = |row: usize| &self.dilated[(row * DISTANCES_PER_CELL + plane) * self.across..][cells.clone()];
            let inside = &mut line[before..][..cells.len()];
            for ((value, above), below) in inside.iter_mut().zip(row(above)).zip(row(below)) {
                *value = above + along.fract() * (below - above);
            }
            // Beyond the picture its outermost cells repeat.
            let (first, last) = (inside[0], inside[cells.len() - 1]);
            line[..before].fill(first);
            line[before + cells.len()..].fill(last);
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
    /// Whether any of some pixels from column `x` of the chunk on may be inside.
    #[inline(always)]
    pub fn any_inside(&self, x: usize, count: usize) -> bool {
        self.0[0][x / SILHOUETTE_CELL..][..count.div_ceil(SILHOUETTE_CELL) + 2].iter().any(|&square| square > 0.0)
    }

    /// Returns the values of some pixels from column `x` of the chunk on, a multiple of their `count`, linear between the
    /// centres of cells.
    #[inline(always)]
    pub fn interpolate(&self, x: usize, count: usize) -> [[f32; MAX_LANES]; 2] {
        let mut pixels = [[0.0; MAX_LANES]; 2];
        let between = |[before, here, after]: [f32; 3], i: usize| {
            let offset = (i as f32 + 0.5) / SILHOUETTE_CELL as f32 - 0.5;
            here + (if offset < 0.0 { before } else { after } - here) * offset.abs()
        };
        for (pixels, line) in pixels.iter_mut().zip(&self.0) {
            let line = &line[x / SILHOUETTE_CELL..];
            let cells = |k: usize| [line[k], line[k + 1], line[k + 2]];
            // A vector that is narrower than a cell begins inside it.
            if count < SILHOUETTE_CELL {
                for (i, value) in pixels[..count].iter_mut().enumerate() {
                    *value = between(cells(0), x % SILHOUETTE_CELL + i);
                }
                continue;
            }
            for (k, group) in pixels[..count].as_chunks_mut::<SILHOUETTE_CELL>().0.iter_mut().enumerate() {
                let cells = cells(k);
                for (i, value) in group.iter_mut().enumerate() {
                    *value = between(cells, i);
                }
            }
        }
        pixels
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

/// Dilates lines of marks along the rows.
struct DilateRows<'a> {
    marks: &'a [f32],
    planes: usize,
    /// Scratch for three lines.
    padded: &'a mut [f32],
    lines: &'a mut [Line],
    out: &'a mut [f32],
}

impl WithSimd for DilateRows<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let across = self.marks.len() / self.lines.len();
        let marks = self.marks.chunks_exact(across);
        for (index, ((line, marks), out)) in
            self.lines.iter_mut().zip(marks).zip(self.out.chunks_exact_mut(across)).enumerate()
        {
            let highest_px = if index % DISTANCES_PER_CELL < self.planes { maximum(marks) } else { NO_SILHOUETTE };
            *line = Line { top: NO_SILHOUETTE, cells: 0..0 };
            if highest_px <= 0.0 {
                continue;
            }
            let is_marked = |&px: &f32| px > 0.0;
            let first = marks.iter().position(is_marked).unwrap_or(0);
            let last = marks.iter().rposition(is_marked).unwrap_or(0);
            line.top = highest_px * highest_px;
            let reach = radius_in_cells(line.top).min(across);
            line.cells = first.saturating_sub(reach)..(last + reach + 1).min(across);
            let padded = &mut self.padded[..across + 2 * reach];
            padded.fill(NO_SILHOUETTE);
            for (square, &px) in padded[reach..].iter_mut().zip(marks) {
                *square = if px > 0.0 { px * px } else { NO_SILHOUETTE };
            }
            out.fill(NO_SILHOUETTE);
            match across < 4 * S::F32_LANES {
                true => dilate_cells::<_, 1>(pulp::Scalar, padded, line.cells.clone(), reach, out),
                false => dilate_cells::<_, 4>(simd, padded, line.cells.clone(), reach, out),
            }
        }
    }
}

/// Computes the highest radius^2 - distance^2 of the silhouettes around some `cells`, `N` vectors at a time, given
/// radius^2 in a line `padded` by `reach` cells.
#[inline(always)]
fn dilate_cells<S: Simd, const N: usize>(simd: S, padded: &[f32], cells: Range<usize>, reach: usize, out: &mut [f32]) {
    let none = simd.splat_f32s(NO_SILHOUETTE);
    for x in groups::<S, N>(cells, out.len()) {
        let at = |vector: usize, from: usize| load::<S>(padded, from + vector * S::F32_LANES);
        let mut highest: [S::f32s; N] = std::array::from_fn(|k| at(k, x + reach));
        for distance in 1..=reach {
            let distance_square = simd.splat_f32s(distance_square(distance));
            for (k, highest) in highest.iter_mut().enumerate() {
                let square = simd.max_f32s(at(k, x + reach - distance), at(k, x + reach + distance));
                *highest = simd.max_f32s(*highest, simd.sub_f32s(square, distance_square));
            }
        }
        for (k, highest) in highest.into_iter().enumerate() {
            let is_within = simd.greater_than_f32s(highest, simd.splat_f32s(0.0));
            store::<S>(out, x + k * S::F32_LANES, simd.select_f32s(is_within, highest, none));
        }
    }
}

/// Returns the first cells of groups of `N` vectors that cover some cells of a line; the last group ends with the line
/// at the latest and may overlap the one before.
fn groups<S: Simd, const N: usize>(cells: Range<usize>, across: usize) -> impl Iterator<Item = usize> {
    cells.step_by(N * S::F32_LANES).map(move |x| x.min(across - N * S::F32_LANES))
}

/// Returns the squared distance of cells, in pixels.
fn distance_square(cells: usize) -> f32 {
    let distance_px = (cells * SILHOUETTE_CELL) as f32;
    distance_px * distance_px
}

/// Dilates lines down the columns, from line `first` on.
struct DilateColumns<'a> {
    row_dilated: &'a [f32],
    lines: &'a [Line],
    planes: usize,
    /// Largest radius, in cells.
    radius: usize,
    first: usize,
    out: &'a mut [f32],
}

impl WithSimd for DilateColumns<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (across, down) = (self.row_dilated.len() / self.lines.len(), self.lines.len() / DISTANCES_PER_CELL);
        for (line, out) in (self.first..).zip(self.out.chunks_exact_mut(across)) {
            let (y, plane) = (line / DISTANCES_PER_CELL, line % DISTANCES_PER_CELL);
            if plane >= self.planes {
                continue;
            }
            // Most lines have no silhouette, or none with a radius that large.
            let near = (y.saturating_sub(self.radius)..(y + self.radius + 1).min(down)).filter_map(|other| {
                let (from, distance_square) = (other * DISTANCES_PER_CELL + plane, distance_square(other.abs_diff(y)));
                (self.lines[from].top - distance_square > NO_SILHOUETTE).then_some((from * across, distance_square))
            });
            let (first, end) = near.clone().fold((across, 0), |(first, end), (from, _)| {
                let cells = &self.lines[from / across].cells;
                (first.min(cells.start), end.max(cells.end))
            });
            out.fill(NO_SILHOUETTE);
            let rows = self.row_dilated;
            match across < 4 * S::F32_LANES {
                true => combine_lines::<_, 1>(pulp::Scalar, rows, near, first..end, out),
                false => combine_lines::<_, 4>(simd, rows, near, first..end, out),
            }
        }
    }
}

/// Computes the highest of lines that begin at these indices of `rows`, each minus its squared distance, in some
/// `cells`, `N` vectors at a time.
#[inline(always)]
fn combine_lines<S: Simd, const N: usize>(
    simd: S,
    rows: &[f32],
    lines: impl Iterator<Item = (usize, f32)> + Clone,
    cells: Range<usize>,
    out: &mut [f32],
) {
    for x in groups::<S, N>(cells, out.len()) {
        let mut highest = [simd.splat_f32s(NO_SILHOUETTE); N];
        for (from, distance_square) in lines.clone() {
            for (k, highest) in highest.iter_mut().enumerate() {
                let square = load::<S>(rows, from + x + k * S::F32_LANES);
                *highest = simd.max_f32s(*highest, simd.sub_f32s(square, simd.splat_f32s(distance_square)));
            }
        }
        for (k, highest) in highest.into_iter().enumerate() {
            store::<S>(out, x + k * S::F32_LANES, highest);
        }
    }
}
