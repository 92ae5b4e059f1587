//! Silhouettes (occlusion boundaries): the depth discontinuities, and how far from them the background is visible.
//!
//! A surface is opaque. Where the CoC changes by less than a pixel from pixel to pixel, a pixel shows only that one
//! surface through the aperture: a ray at CoC `c` is `|c|` away from the pixel, so nothing from behind appears farther
//! from a silhouette than the radius there. Each discontinuity marks this distance on a coarse grid; the marks are then
//! dilated.
//!
//! twin: shaders/spread.wgsl, shaders/uncover.wgsl

#![allow(clippy::needless_range_loop)] // Lanes index two arrays at once.

use std::ops::Range;
use std::sync::atomic::AtomicBool;

use pulp::Arch;

use super::encode::CHUNK;
use crate::bokeh::occlusion::{GRAIN, SHOWS};
use crate::compute::thread_pool::{DisjointParts, ThreadPool};

/// Distance without a silhouette.
pub const NONE: f32 = -1.0;
/// Rows of the grid per work item.
const PART: usize = 8;

/// The grid over a picture: `[row][SHOWS][across]`.
pub struct Silhouettes {
    /// Columns and rows of the grid.
    across: usize,
    down: usize,
    /// Radius of the silhouettes in a cell, in pixels; [`NONE`] without any.
    marks: Vec<f32>,
    /// After the dilation along rows: the maximum over silhouettes of radius^2 - distance^2.
    along: Vec<f32>,
    /// Maximum of each line of `along`, `[row][SHOWS]`.
    tops: Vec<f32>,
    /// After the dilation along rows and columns: above 0 within the radius of a silhouette.
    reached: Vec<f32>,
    taken: Vec<AtomicBool>,
}

impl Silhouettes {
    /// Allocates for pictures of `width` x `height` pixels.
    pub fn new(width: usize, height: usize) -> Self {
        let (across, down) = (width.div_ceil(GRAIN), height.div_ceil(GRAIN));
        let cells = vec![NONE; across * SHOWS * down];
        let taken = std::iter::repeat_with(|| AtomicBool::new(false)).take(down).collect();
        let tops = vec![NONE; SHOWS * down];
        Self { across, down, marks: cells.clone(), along: cells.clone(), tops, reached: cells, taken }
    }

    /// Returns the marks, to be written in parts of `rows` rows of the picture, whole rows of the grid.
    pub fn marks(&mut self, rows: usize) -> DisjointParts<'_, f32> {
        DisjointParts::new(&mut self.marks, rows / GRAIN * SHOWS * self.across, &mut self.taken)
    }

    /// Dilates the marks by their radii, along the rows and then down the columns.
    pub fn spread(&mut self, workers: &mut ThreadPool, arch: Arch) {
        let (across, row_len, down) = (self.across, self.across * SHOWS, self.down);
        let marks = &self.marks;
        let parts = DisjointParts::new(&mut self.along, PART * row_len, &mut self.taken);
        workers.run(down.div_ceil(PART), &|part| {
            let rows = parts.part(part);
            let marks = &marks[part * PART * row_len..][..rows.len()];
            arch.dispatch(|| {
                for (out, marks) in rows.chunks_exact_mut(across).zip(marks.chunks_exact(across)) {
                    spread_row(marks, out);
                }
            });
        });
        arch.dispatch(|| {
            for (top, line) in self.tops.iter_mut().zip(self.along.chunks_exact(across)) {
                *top = highest(line);
            }
        });
        let (along, tops) = (&self.along, &self.tops);
        let reach = cells_within(highest(tops));
        let parts = DisjointParts::new(&mut self.reached, PART * row_len, &mut self.taken);
        workers.run(down.div_ceil(PART), &|part| {
            let rows = parts.part(part);
            arch.dispatch(|| {
                for (line, out) in (part * PART * SHOWS..).zip(rows.chunks_exact_mut(across)) {
                    let (y, plane) = (line / SHOWS, line % SHOWS);
                    out.fill(NONE);
                    for other in y.saturating_sub(reach)..(y + reach + 1).min(down) {
                        let (from, distance_px) = (other * SHOWS + plane, (other.abs_diff(y) * GRAIN) as f32);
                        let distance_square = distance_px * distance_px;
                        // Most lines have no silhouette, or none with a radius that large.
                        if tops[from] - distance_square > NONE {
                            keep_highest(out, &along[from * across..][..across], distance_square);
                        }
                    }
                }
            });
        });
    }

    /// Whether any pixel of a chunk of some rows, from column `x0` on, may be within the radius of a silhouette. If
    /// not, [`Self::reaching`] is `None` in all of them.
    #[inline(always)]
    pub fn may_reach(&self, rows: Range<usize>, x0: usize) -> bool {
        let mut rows = (rows.start / GRAIN).saturating_sub(1)..(rows.end.div_ceil(GRAIN) + 1).min(self.down);
        let columns = (x0 / GRAIN).saturating_sub(1)..((x0 + CHUNK) / GRAIN + 1).min(self.across);
        rows.any(|row| {
            let line = &self.reached[row * SHOWS * self.across..][..self.across];
            line[columns.clone()].iter().any(|&square| square > 0.0)
        })
    }

    /// Returns radius^2 - distance^2 of silhouettes for a chunk of row `y` from column `x0` on, a multiple of the
    /// grain: for any silhouette, and for those whose background is not in front. Returns `None` if all are outside.
    #[inline(always)]
    pub fn reaching(&self, y: usize, x0: usize) -> Option<Reaching> {
        let along = ((y as f32 + 0.5) / GRAIN as f32 - 0.5).max(0.0);
        let above = (along as usize).min(self.down - 1);
        let below = (above + 1).min(self.down - 1);
        let mut reaching = Reaching([[0.0; CELLS]; 2]);
        for (plane, line) in reaching.0.iter_mut().enumerate() {
            let row = |row: usize| &self.reached[(row * SHOWS + plane) * self.across..][..self.across];
            let (above, below, first) = (row(above), row(below), x0 / GRAIN);
            if first > 0 && first + CELLS <= self.across {
                let (above, below) = (&above[first - 1..][..CELLS], &below[first - 1..][..CELLS]);
                for k in 0..CELLS {
                    line[k] = above[k] + along.fract() * (below[k] - above[k]);
                }
            } else {
                for (k, value) in line.iter_mut().enumerate() {
                    let x = (first + k).saturating_sub(1).min(self.across - 1);
                    *value = above[x] + along.fract() * (below[x] - above[x]);
                }
            }
        }
        (highest(&reaching.0[0]) > 0.0).then_some(reaching)
    }

    /// Returns the cells of row `y` of the picture: above 0 where the background past a silhouette is visible, and
    /// where the background that it hides matters.
    #[inline(always)]
    pub fn row(&self, y: usize) -> [&[f32]; 2] {
        [0, SHOWS - 1].map(|plane| &self.reached[(y / GRAIN * SHOWS + plane) * self.across..][..self.across])
    }
}

/// Cells of a chunk, plus one on both sides.
const CELLS: usize = CHUNK / GRAIN + 2;
/// Lanes of the widest vector.
const WIDEST: usize = 16;

/// The maximum of radius^2 - distance^2, by the cells of a chunk: see [`Silhouettes::reaching`].
pub struct Reaching([[f32; CELLS]; 2]);

impl Reaching {
    /// Returns the values of some pixels from column `x` of the chunk on, linear between the centres of cells; `None`
    /// if all are outside.
    #[inline(always)]
    pub fn pixels(&self, x: usize, count: usize) -> Option<[[f32; WIDEST]; 2]> {
        let cells = &self.0[0][x / GRAIN..][..count / GRAIN + 2];
        if cells.iter().all(|&square| square <= 0.0) {
            return None;
        }
        let mut pixels = [[0.0; WIDEST]; 2];
        for (pixels, line) in pixels.iter_mut().zip(&self.0) {
            let line = &line[x / GRAIN..];
            for (k, group) in pixels[..count].as_chunks_mut::<GRAIN>().0.iter_mut().enumerate() {
                let (before, here, after) = (line[k], line[k + 1], line[k + 2]);
                for (i, value) in group.iter_mut().enumerate() {
                    let offset = (i as f32 + 0.5) / GRAIN as f32 - 0.5;
                    *value = here + (if offset < 0.0 { before } else { after } - here) * offset.abs();
                }
            }
        }
        Some(pixels)
    }
}

/// Returns the maximum.
#[inline(always)]
pub fn highest(values: &[f32]) -> f32 {
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
fn cells_within(square: f32) -> usize {
    if square < 0.0 { 0 } else { square.sqrt() as usize / GRAIN + 1 }
}

/// Dilates the marks of a row along it, one by one: there are few.
#[inline(always)]
fn spread_row(marks: &[f32], out: &mut [f32]) {
    out.fill(NONE);
    for (x, &px) in marks.iter().enumerate().filter(|&(_, &px)| px > 0.0) {
        let reach = cells_within(px * px);
        let first = x.saturating_sub(reach);
        for (to, out) in (first..).zip(&mut out[first..(x + reach + 1).min(marks.len())]) {
            let distance_px = (to.abs_diff(x) * GRAIN) as f32;
            let square = if px > distance_px { px * px - distance_px * distance_px } else { NONE };
            *out = if square > *out { square } else { *out };
        }
    }
}

#[inline(always)]
fn keep_highest(out: &mut [f32], along: &[f32], distance_square: f32) {
    for (out, &square) in out.iter_mut().zip(along) {
        let left = square - distance_square;
        *out = if left > *out { left } else { *out };
    }
}
