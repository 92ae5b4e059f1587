//! Which surface is behind each cell of what hides others, and which of its pixels may be seen through.

use std::ops::Range;

use pulp::{Arch, WithSimd};

use super::survey::{FRONT_STEP, MIN_STEP_PX, Seed};
use super::{CELL, Frame, Grid, Hiding, split_rows};
use crate::compute::thread_pool::ThreadPool;
use crate::frame::{reset_buffer, resize_buffer};

/// Pixels beyond the radius that are told, too: the local radius of the blur is a mean.
const BEYOND_PX: f32 = 2.0;
/// Difference of squared distances, in pixels, that tells no side of an outline: pixels so near to it do by their CoC.
const SLACK_PX2: f32 = 4.0;
/// Largest reach of a blur that is marked, in pixels.
const MAX_REACH_PX: f32 = 4096.0;
/// Index of no seed.
const NONE: u32 = u32::MAX;

/// The nearest outline of each cell of what is in front, and the surface behind it.
#[derive(Debug, Default)]
pub struct Labels {
    /// Index of the seed; [`NONE`] without any.
    seed: Vec<u32>,
    /// Squared distance of the seed from the centre of the cell, in pixels.
    square: Vec<f32>,
    /// A bit for each hidden pixel of a cell, row by row.
    pub mask: Vec<u8>,
    /// CoC of the surface behind, in pixels, where the mask is not 0.
    pub behind_px: Vec<f32>,
    /// First and end of the rows with hidden cells.
    pub rows: (usize, usize),
    /// What each band has, and the numbers of all.
    marked: Vec<Marked>,
    counts: Vec<usize>,
}

/// Hidden pixels of a band.
#[derive(Debug, Default)]
struct Marked {
    /// Their numbers by distance from the outline, rounded up to pixels.
    counts: Vec<usize>,
    /// First and end of the rows with hidden cells.
    rows: (usize, usize),
}

/// What hides, and where.
#[derive(Clone, Copy)]
pub struct Scene<'a> {
    pub grid: &'a Grid,
    pub frame: &'a Frame<'a>,
    pub seeds: &'a [Seed],
}

impl Labels {
    /// Returns the seed of a cell with hidden pixels.
    #[inline(always)]
    pub fn seed<'a>(&self, seeds: &'a [Seed], cell: usize) -> &'a Seed {
        &seeds[self.seed[cell] as usize]
    }

    /// Returns the squared distance of a cell in front from its outline, in pixels; infinite in others.
    pub fn square(&self, cell: usize) -> f32 {
        self.square[cell]
    }

    /// Gives each cell in front the nearest seed, in two passes with both directions along the rows (after Danielsson,
    /// *Euclidean Distance Mapping*, 1980).
    pub fn spread(&mut self, grid: &Grid, nearest_px: &[f32], seeds: &[Seed]) {
        resize_buffer(&mut self.seed, nearest_px.len());
        resize_buffer(&mut self.square, nearest_px.len());
        let (columns, rows) = (grid.columns.0..grid.columns.1, grid.rows.0..grid.rows.1);
        for y in rows.clone() {
            let row = y * grid.across + columns.start..y * grid.across + columns.end;
            self.seed[row.clone()].fill(NONE);
            self.square[row].fill(f32::INFINITY);
        }
        for (k, seed) in (0..).zip(seeds) {
            let (x, y) = (seed.at.0 as usize / CELL, seed.at.1 as usize / CELL);
            self.offer(grid, seeds, (x, y), k);
        }
        for is_up in [false, true] {
            for k in 0..rows.len() {
                let y = if is_up { rows.end - 1 - k } else { rows.start + k };
                let before = if is_up { y + 1 } else { y.wrapping_sub(1) };
                let has_before = rows.contains(&before);
                for is_back in [false, true] {
                    for k in 0..columns.len() {
                        let x = if is_back { columns.end - 1 - k } else { columns.start + k };
                        if !grid.hiding.is_front(nearest_px[y * grid.across + x]) {
                            continue;
                        }
                        let beside = if is_back { x + 1 } else { x.wrapping_sub(1) };
                        if columns.contains(&beside) {
                            self.offer(grid, seeds, (x, y), self.seed[y * grid.across + beside]);
                        }
                        if has_before && !is_back {
                            for x_before in x.max(columns.start + 1) - 1..(x + 2).min(columns.end) {
                                self.offer(grid, seeds, (x, y), self.seed[before * grid.across + x_before]);
                            }
                        }
                    }
                }
            }
        }
    }

    /// Gives a cell this seed if it is nearer than its own.
    #[inline(always)]
    fn offer(&mut self, grid: &Grid, seeds: &[Seed], (x, y): (usize, usize), index: u32) {
        let cell = y * grid.across + x;
        if index == NONE || index == self.seed[cell] {
            return;
        }
        let (x_px, y_px) = grid.centre_px(x, y);
        let square = square_to(seeds[index as usize].at, (x_px, y_px));
        if square < self.square[cell] {
            (self.seed[cell], self.square[cell]) = (index, square);
        }
    }

    /// Marks the hidden pixels, at most `budget`: those that the blur lets through, if another surface is behind them. If
    /// these are too many, only those up to a smaller distance from their outline.
    pub fn choose(
        &mut self,
        workers: &mut ThreadPool,
        bands: impl Iterator<Item = Range<usize>> + Clone,
        scene: Scene,
        budget: usize,
    ) {
        reset_buffer(&mut self.mask, self.seed.len());
        resize_buffer(&mut self.behind_px, self.seed.len());
        let most_px = scene.frame.lens.max_coc_px + BEYOND_PX;
        self.mark(workers, bands.clone(), scene, most_px);
        if self.counts.iter().sum::<usize>() <= budget {
            return;
        }
        let up_to = self.counts.iter().scan(0, |sum, count| {
            *sum += count;
            Some(*sum)
        });
        let reach_px = up_to.take_while(|&count| count <= budget).count().saturating_sub(1);
        if reach_px > 0 {
            self.mark(workers, bands, scene, reach_px as f32);
        } else {
            // More outlines than that are noise.
            self.mask.fill(0);
            self.rows = (0, 0);
        }
    }

    /// Marks the hidden pixels within `reach_px` of their outline, and counts them.
    fn mark(
        &mut self,
        workers: &mut ThreadPool,
        bands: impl Iterator<Item = Range<usize>> + Clone,
        scene: Scene,
        reach_px: f32,
    ) {
        let Self { seed, square, mask, behind_px, marked, rows, counts } = self;
        let (arch, across) = (Arch::new(), scene.grid.across);
        marked.resize_with(bands.clone().count(), Marked::default);
        let (labels, reach_px) = ((&seed[..], &square[..]), reach_px.min(MAX_REACH_PX));
        let planes = split_rows(mask, bands.clone(), across).zip(split_rows(behind_px, bands.clone(), across));
        workers.run_each(bands.zip(planes).zip(marked.iter_mut()), &|((rows, (mask, behind_px)), marked)| {
            arch.dispatch(MarkRows { scene, labels, reach_px, rows, mask, behind_px, marked });
        });
        *rows = (usize::MAX, 0);
        counts.clear();
        counts.resize(reach_px as usize + 2, 0);
        for marked in marked {
            *rows = (rows.0.min(marked.rows.0), rows.1.max(marked.rows.1));
            counts.iter_mut().zip(&marked.counts).for_each(|(all, count)| *all += count);
        }
    }
}

/// Marks the hidden pixels of some rows of cells.
struct MarkRows<'a> {
    scene: Scene<'a>,
    /// Seed and squared distance of all cells.
    labels: (&'a [u32], &'a [f32]),
    reach_px: f32,
    rows: Range<usize>,
    mask: &'a mut [u8],
    behind_px: &'a mut [f32],
    marked: &'a mut Marked,
}

impl WithSimd for MarkRows<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { scene: Scene { grid, frame, seeds }, labels, reach_px, rows, mask, behind_px, marked } = self;
        let (width, height) = grid.size;
        // The nearest corner of a cell is less than a pixel from its centre.
        let most_square = (reach_px + 1.0) * (reach_px + 1.0);
        marked.counts.clear();
        marked.counts.resize(reach_px as usize + 2, 0);
        marked.rows = (usize::MAX, 0);
        for y in grid.limit_rows(rows.clone()) {
            for x in grid.columns.0..grid.columns.1 {
                let (cell, own) = (y * grid.across + x, (y - rows.start) * grid.across + x);
                mask[own] = 0;
                if labels.0[cell] == NONE || labels.1[cell] > most_square {
                    continue;
                }
                let seed = &seeds[labels.0[cell] as usize];
                for k in 0..CELL * CELL {
                    let at = (CELL * x + k % CELL, CELL * y + k / CELL);
                    if at.0 >= width || at.1 >= height {
                        continue;
                    }
                    let own_px = frame.coc_px(at.1 * width + at.0);
                    if let Some(square) = hidden_square(&grid.hiding, seed, at, own_px, reach_px) {
                        mask[own] |= 1 << k;
                        marked.counts[square.sqrt().ceil() as usize] += 1;
                    }
                }
                if mask[own] != 0 {
                    behind_px[own] = seed.behind_px;
                    marked.rows = (marked.rows.0.min(y), y + 1);
                }
            }
        }
    }
}

/// Returns the squared distance of a pixel at this column and row from the seed's outline, in pixels, if it hides what is
/// behind that, and the blur lets that through.
#[inline(always)]
fn hidden_square(hiding: &Hiding, seed: &Seed, (x, y): (usize, usize), own_px: f32, reach_px: f32) -> Option<f32> {
    let at = (x as f32, y as f32);
    let (square, behind_square) = (square_to(seed.at, at), square_to(seed.behind, at));
    let is_same = (own_px - seed.own_px).abs() < MIN_STEP_PX.max(FRONT_STEP * seed.own_px.abs());
    let radius_px = (own_px.abs().max(seed.behind_px.abs()) + BEYOND_PX).min(reach_px);
    // On the other side of the outline is what carries the thing in front: the ground beside it. The seed is the nearest one of
    // the cell, not of the pixel.
    let is_hidden =
        hiding.includes(own_px) & is_same & (behind_square + SLACK_PX2 > square) & (square <= radius_px * radius_px);
    is_hidden.then_some(square)
}

#[inline(always)]
fn square_to(to: (u32, u32), from: (f32, f32)) -> f32 {
    let (x, y) = (to.0 as f32 - from.0, to.1 as f32 - from.1);
    x * x + y * y
}
