//! Rays: fills the hidden cells with what is seen of their surface around, and makes the matte's pixels of it.

use std::ops::Range;

use pulp::WithSimd;

use super::labels::Labels;
use super::survey::{SAME_PX, Seed};
use super::{CELL, Cells, Frame, Grid};
use crate::frame::{Matte, MixedPixel};

/// Steps of the rays, across and down, and their lengths. Sixteen directions were not better.
const DIRECTIONS: [((isize, isize), f32); 8] = [
    ((1, 0), 1.0),
    ((1, 1), std::f32::consts::SQRT_2),
    ((0, 1), 1.0),
    ((-1, 1), std::f32::consts::SQRT_2),
    ((-1, 0), 1.0),
    ((-1, -1), std::f32::consts::SQRT_2),
    ((0, -1), 1.0),
    ((1, -1), std::f32::consts::SQRT_2),
];
/// Longest ray, in steps.
pub const MAX_STEPS: usize = 32;
/// Length of the run at a ray's end that is averaged, as a factor of the ray's length, and the longest one, in cells: what
/// is hidden far inside is best a mean, as texture that is guessed wrong costs more than none.
const RUN: usize = 2;
pub const MAX_RUN: usize = 16;
/// Cells read of a run.
const SAMPLES: usize = 8;
/// CoC difference up to which filled cells are interpolated, in pixels.
const BLENDED_PX: f32 = 2.0;

/// Fills hidden cells.
#[derive(Clone, Copy)]
pub struct FillCells<'a> {
    pub frame: &'a Frame<'a>,
    pub grid: &'a Grid,
    pub cells: &'a Cells,
    pub labels: &'a Labels,
    pub seeds: &'a [Seed],
}

impl<'a> FillCells<'a> {
    /// Prepares some rows, which are written to `filled`: linear light, and inverse depth in 1/m.
    pub fn rows(self, rows: Range<usize>, filled: &'a mut [[f32; 4]]) -> FillRows<'a> {
        FillRows { fill: self, rows, filled }
    }

    /// Returns what a hidden cell hides.
    #[inline(always)]
    fn fill_cell(&self, x: usize, y: usize) -> [f32; 4] {
        let (mut sum, mut total) = ([0.0; 4], 0.0);
        for direction in DIRECTIONS {
            let Some((steps, hit)) = self.shoot(x, y, direction.0) else { continue };
            let weight = 1.0 / (steps as f32 * direction.1);
            (0..4).for_each(|p| sum[p] += weight * hit[p]);
            total += weight;
        }
        if total > 0.0 {
            return sum.map(|value| value / total);
        }
        let seed = self.labels.seed(self.seeds, y * self.grid.across + x);
        self.frame.light_at(seed.behind.1 as usize * self.grid.size.0 + seed.behind.0 as usize)
    }

    /// Returns the steps to the first cell of the hidden surface, and what there is.
    #[inline(always)]
    fn shoot(&self, x: usize, y: usize, (across, down): (isize, isize)) -> Option<(usize, [f32; 4])> {
        let grid = self.grid;
        let inside = |from: usize, by: isize, (first, end): (usize, usize)| match by {
            0 => usize::MAX,
            1 => end - 1 - from,
            _ => from - first,
        };
        // Steps to the last cell inside.
        let most = inside(x, across, grid.columns).min(inside(y, down, grid.rows));
        let from = y * grid.across + x;
        let stride = down * grid.across as isize + across;
        let at = |steps: usize| from.wrapping_add_signed(stride * steps as isize);
        let behind_px = self.labels.behind_px[from];
        let is_it = |cell: usize| (self.cells.surface_px[cell] - behind_px).abs() < SAME_PX;
        let steps = (1..=most.min(MAX_STEPS)).find(|&steps| is_it(at(steps)))?;
        let run = (1 + RUN * steps).min(MAX_RUN);
        let (mut sum, mut count) = ([0.0; 4], 0);
        let samples = (steps..=most).step_by(run.div_ceil(SAMPLES)).take(run.min(SAMPLES)).map(at);
        for cell in samples.take_while(|&cell| is_it(cell)) {
            let light = &self.cells.light[cell];
            (0..3).for_each(|p| sum[p] += light[p]);
            count += 1;
        }
        let [r, g, b, _] = sum.map(|value| value / count as f32);
        Some((steps, [r, g, b, self.cells.light[at(steps)][3]]))
    }
}

/// Fills the hidden cells of some rows.
pub struct FillRows<'a> {
    fill: FillCells<'a>,
    rows: Range<usize>,
    filled: &'a mut [[f32; 4]],
}

impl WithSimd for FillRows<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { fill, rows, filled } = self;
        let grid = fill.grid;
        for y in rows.start.max(fill.labels.rows.0)..rows.end.min(fill.labels.rows.1) {
            for x in grid.columns.0..grid.columns.1 {
                if fill.labels.mask[y * grid.across + x] != 0 {
                    filled[(y - rows.start) * grid.across + x] = fill.fill_cell(x, y);
                }
            }
        }
    }
}

/// Filled cells, to be told as pixels.
#[derive(Clone, Copy)]
pub struct FilledCells<'a> {
    pub frame: &'a Frame<'a>,
    pub grid: &'a Grid,
    pub labels: &'a Labels,
    pub filled: &'a [[f32; 4]],
}

impl<'a> FilledCells<'a> {
    /// Prepares some rows of cells: replaces `pixels` by theirs of `matte`, and the hidden ones among these.
    pub fn merge(self, rows: Range<usize>, matte: &'a Matte, pixels: &'a mut Vec<MixedPixel>) -> MergeRows<'a> {
        MergeRows { filled: self, rows, matte, pixels }
    }

    /// Returns the light that a pixel of a hidden cell hides: bilinear between the centres of filled cells of the same surface.
    #[inline(always)]
    fn light_at(&self, x: usize, y: usize) -> [f32; 3] {
        let grid = self.grid;
        let here = y / CELL * grid.across + x / CELL;
        let beside = |at: usize, (first, end): (usize, usize)| {
            let cell = at / CELL;
            let other = if at.is_multiple_of(CELL) { cell.wrapping_sub(1) } else { cell + 1 };
            if (first..end).contains(&other) { other } else { cell }
        };
        let (x, y) = ([x / CELL, beside(x, grid.columns)], [y / CELL, beside(y, grid.rows)]);
        let (mut sum, mut total) = ([0.0; 3], 0.0);
        for (k, weight) in [9.0, 3.0, 3.0, 1.0].into_iter().enumerate() {
            let cell = y[k / 2] * grid.across + x[k % 2];
            let is_same = (self.labels.behind_px[cell] - self.labels.behind_px[here]).abs() < BLENDED_PX;
            if self.labels.mask[cell] != 0 && is_same {
                (0..3).for_each(|p| sum[p] += weight * self.filled[cell][p]);
                total += weight;
            }
        }
        sum.map(|value| value / total)
    }

    /// Returns the matte's pixel for a hidden one.
    #[inline(always)]
    fn hidden_pixel(&self, x: usize, y: usize) -> MixedPixel {
        let at = y * self.grid.size.0 + x;
        let (own, behind) = (self.frame.light_at(at), self.light_at(x, y));
        let cell = y / CELL * self.grid.across + x / CELL;
        // Depth is that of the cell: a mean of two surfaces is on neither.
        let far_m = self.filled[cell][3].recip();
        let background_alpha = self.grid.hiding.fade.map_or(1.0, |fade| {
            let limit_px = (fade * self.labels.behind_px[cell].abs()).max(1.0);
            (1.0 - self.labels.square(cell).sqrt() / limit_px).max(0.0)
        });
        MixedPixel {
            at: at as u32,
            near_m: self.frame.metres[at],
            far_m,
            alpha: 1.0,
            background_alpha,
            difference: [own[0] - behind[0], own[1] - behind[1], own[2] - behind[2]],
        }
    }
}

/// Merges the hidden pixels of some rows of cells into the matte's.
pub struct MergeRows<'a> {
    filled: FilledCells<'a>,
    rows: Range<usize>,
    matte: &'a Matte,
    pixels: &'a mut Vec<MixedPixel>,
}

impl WithSimd for MergeRows<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { filled, rows, matte, pixels } = self;
        let FilledCells { grid, labels, .. } = filled;
        let (width, height) = grid.size;
        let lines = CELL * rows.start..(CELL * rows.end).min(height);
        let mut before = matte.pixels_in(lines.start * width..lines.end * width);
        pixels.clear();
        for y in lines {
            let masks = &labels.mask[y / CELL * grid.across..][..grid.across];
            let columns = if (labels.rows.0..labels.rows.1).contains(&(y / CELL)) { grid.columns } else { (0, 0) };
            for cell in (columns.0..columns.1).filter(|&cell| masks[cell] != 0) {
                for k in 0..CELL {
                    let x = CELL * cell + k;
                    if masks[cell] >> (y % CELL * CELL + k) & 1 == 0 {
                        continue;
                    }
                    let count = before.iter().take_while(|pixel| (pixel.at as usize) < y * width + x).count();
                    pixels.extend_from_slice(&before[..count]);
                    before = &before[count..];
                    if before.first().is_none_or(|pixel| pixel.at as usize != y * width + x) {
                        pixels.push(filled.hidden_pixel(x, y));
                    }
                }
            }
        }
        pixels.extend_from_slice(before);
    }
}
