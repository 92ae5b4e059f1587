//! Which surface is behind each cell of a near thing, and which of its pixels may be seen through.

use super::survey::{MIN_STEP_PX, NEAR_STEP, Seed};
use super::{CELL, Frame, Grid, NEAR_PX};
use crate::frame::{reset_buffer, resize_buffer};

/// Pixels beyond the radius that are told, too: the local radius of the blur is a mean.
const BEYOND_PX: f32 = 2.0;
/// Difference of squared distances, in pixels, that tells no side of an outline: pixels so near to it do by their CoC.
const SLACK_PX2: f32 = 4.0;
/// Factor by which the reach falls, if all within it are too many.
const LESS: f32 = 0.9;
/// Index of no seed.
const NONE: u32 = u32::MAX;

/// The nearest outline of each cell of a near thing, and the surface behind it.
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
}

impl Labels {
    /// Returns the seed of a cell with hidden pixels.
    #[inline(always)]
    pub fn seed<'a>(&self, seeds: &'a [Seed], cell: usize) -> &'a Seed {
        &seeds[self.seed[cell] as usize]
    }

    /// Returns the squared distance of a near cell from its outline, in pixels; infinite in others.
    pub fn square(&self, cell: usize) -> f32 {
        self.square[cell]
    }

    /// Gives each near cell the nearest seed, in two passes with both directions along the rows (after Danielsson,
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
                        if nearest_px[y * grid.across + x] >= NEAR_PX {
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

    /// Marks the hidden pixels, at most `budget`: those that the blur lets through, if another surface is behind them.
    pub fn choose(&mut self, grid: &Grid, frame: &Frame, seeds: &[Seed], budget: usize) {
        reset_buffer(&mut self.mask, self.seed.len());
        resize_buffer(&mut self.behind_px, self.seed.len());
        let mut reach_px = frame.lens.max_coc_px + BEYOND_PX;
        while self.mark(grid, frame, seeds, reach_px) > budget {
            reach_px *= LESS;
            if reach_px < 1.0 {
                // More outlines than that are noise.
                self.mask.fill(0);
                self.rows = (0, 0);
                return;
            }
        }
    }

    /// Marks the hidden pixels within `reach_px` of their outline. Returns their number.
    fn mark(&mut self, grid: &Grid, frame: &Frame, seeds: &[Seed], reach_px: f32) -> usize {
        let (width, height) = grid.size;
        let mut count = 0;
        self.rows = (usize::MAX, 0);
        for y in grid.rows.0..grid.rows.1 {
            for x in grid.columns.0..grid.columns.1 {
                let cell = y * grid.across + x;
                self.mask[cell] = 0;
                if self.seed[cell] == NONE {
                    continue;
                }
                let seed = &seeds[self.seed[cell] as usize];
                for k in 0..CELL * CELL {
                    let (x, y) = (CELL * x + k % CELL, CELL * y + k / CELL);
                    if x < width && y < height {
                        let is_hidden = is_hidden(seed, (x, y), frame.coc_px(y * width + x), reach_px);
                        self.mask[cell] |= u8::from(is_hidden) << k;
                    }
                }
                if self.mask[cell] != 0 {
                    self.behind_px[cell] = seed.behind_px;
                    self.rows = (self.rows.0.min(y), y + 1);
                    count += self.mask[cell].count_ones() as usize;
                }
            }
        }
        count
    }
}

/// Whether a pixel at this column and row hides what is behind the seed's outline, and the blur lets that through.
#[inline(always)]
fn is_hidden(seed: &Seed, (x, y): (usize, usize), own_px: f32, reach_px: f32) -> bool {
    let at = (x as f32, y as f32);
    let (square, behind_square) = (square_to(seed.at, at), square_to(seed.behind, at));
    let is_same = (own_px - seed.own_px).abs() < MIN_STEP_PX.max(NEAR_STEP * seed.own_px.abs());
    let radius_px = (own_px.abs().max(seed.behind_px.abs()) + BEYOND_PX).min(reach_px);
    // On the other side of the outline is what carries the near thing: the ground beside it. The seed is the nearest one of
    // the cell, not of the pixel.
    (own_px < NEAR_PX) & is_same & (behind_square + SLACK_PX2 > square) & (square <= radius_px * radius_px)
}

#[inline(always)]
fn square_to(to: (u32, u32), from: (f32, f32)) -> f32 {
    let (x, y) = (to.0 as f32 - from.0, to.1 as f32 - from.1);
    x * x + y * y
}
