//! The cells of a picture: what its mask says of each, and the colours of both surfaces around it.

use std::ops::Range;

use super::Backdrop;
use crate::depth::matting::clusters::Color;
use crate::depth::matting::contrast::Contrast;
use crate::depth::matting::symmetric::{Symmetric, outer};
use crate::depth::tap::Tap;
use crate::frame::{ColorImage, Mask};

/// From here on the mask is sure that a pixel is of the nearer surface, and below 1 less this, that it is not.
const SURE: f32 = 0.95;
/// So many cells in every direction tell the colours around one.
pub const REACH: usize = 5;
/// Less weight of pixels than this, of either surface, tells no colour.
const LEAST_WEIGHT: f32 = 0.5;

/// Variance of the light of a picture of what is behind: noise, and half a pixel of shift.
const NOISE: f32 = 2e-4;

/// The weights of the cells around one, by row and column.
pub type Kernel = [[f32; 2 * REACH + 1]; 2 * REACH + 1];

/// What a mask says of a cell of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cell {
    Near,
    Far,
    /// In the band, or beside it.
    Band,
}

/// Pixels of both surfaces in a cell, [`SURFACE`] sums each: how many, their light, and the products of that.
#[derive(Clone, Copy, Debug)]
pub struct Sums([f32; 2 * SURFACE]);

/// Sums of a surface: ten, and up to whole vectors.
const SURFACE: usize = 12;
/// Places of the near and of the far surface.
const NEAR: usize = 0;
const FAR: usize = 1;

impl Sums {
    const NONE: Self = Self([0.0; 2 * SURFACE]);

    #[inline(always)]
    fn add(&mut self, surface: usize, light: [f32; 3]) {
        let sums = &mut self.0[surface * SURFACE..][..SURFACE];
        let [xx, xy, xz, yy, yz, zz] = outer(light);
        let values = [1.0, light[0], light[1], light[2], xx, xy, xz, yy, yz, zz, 0.0, 0.0];
        sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
    }

    #[inline(always)]
    fn add_all(&mut self, other: &Self, weight: f32) {
        self.0.iter_mut().zip(&other.0).for_each(|(sum, value)| *sum += weight * value);
    }

    /// The colours of both; `None` where there are too few pixels of one. What is `behind` anyway is known but for noise.
    fn colors(&self, behind: bool) -> Option<[Color; 2]> {
        let noise = Color { mean: [0.0; 3], covariance: [NOISE, 0.0, 0.0, NOISE, 0.0, NOISE] };
        let weights = [self.0[0], self.0[SURFACE]];
        let color = |k: usize| {
            let sums = &self.0[k * SURFACE + 1..];
            let squares: Symmetric = std::array::from_fn(|k| sums[3 + k]);
            Color::of_sums(weights[k], std::array::from_fn(|k| sums[k]), squares)
        };
        match weights.map(|weight| weight > LEAST_WEIGHT) {
            [true, _] if behind => Some([color(NEAR), noise]),
            [true, true] => Some([color(NEAR), color(FAR)]),
            _ => None,
        }
    }
}

/// A picture, and what is sought in it.
pub struct View<'a> {
    pub mask: &'a Mask,
    pub color: &'a ColorImage,
    pub light: &'a [f32; 256],
    pub backdrop: Option<&'a Backdrop<'a>>,
    /// Per column of the picture, those of the mask on both sides.
    pub columns: &'a [Tap],
    pub cell_px: usize,
    pub across: usize,
    pub down: usize,
}

impl View<'_> {
    /// Columns of the pixels of a column of cells.
    #[inline(always)]
    pub fn columns_of(&self, column: usize) -> Range<usize> {
        column * self.cell_px..((column + 1) * self.cell_px).min(self.color.width as usize)
    }

    /// Rows of the pixels of a row of cells.
    #[inline(always)]
    pub fn rows_of(&self, row: usize) -> Range<usize> {
        row * self.cell_px..((row + 1) * self.cell_px).min(self.color.height as usize)
    }

    /// The colour of a pixel in linear light.
    #[inline(always)]
    pub fn light_at(&self, at: usize) -> [f32; 3] {
        [0, 1, 2].map(|p| self.light[usize::from(self.color.rgb[3 * at + p])])
    }

    /// The mask in a row of pixels, linear between its own.
    #[inline(always)]
    pub fn shares_in(&self, y: usize) -> impl Fn(usize) -> f32 {
        let width = self.mask.width as usize;
        let Tap { first, second, share } = Tap::new(y, self.color.height as usize, self.mask.height as usize);
        let row = |row: usize| &self.mask.share[row * width..][..width];
        let (above, below, columns) = (row(first), row(second), self.columns);
        move |x| {
            let across = &columns[x];
            let between = |row: &[f32]| row[across.first] + (row[across.second] - row[across.first]) * across.share;
            let above = between(above);
            above + (between(below) - above) * share
        }
    }

    /// What the mask says of every cell: it is sure of all of it, or not. `ends` is memory for that.
    #[inline(always)]
    pub fn classify(&self, cells: &mut Vec<Cell>, ends: &mut Vec<[f32; 2]>) {
        let (across, down, mask) = (self.across, self.down, self.mask);
        let range = |of: usize, count: usize, side: usize| {
            // The pixels of the mask around a cell, with those beside them: the band is a cell wider than it needs be.
            let scale = side as f32 / count as f32;
            let start = (of as f32 * scale - 1.0).max(0.0) as usize;
            start.min(side - 1)..(((of + 1) as f32 * scale + 1.0).ceil() as usize).min(side)
        };
        let width = mask.width as usize;
        cells.clear();
        for row in 0..down {
            // Lowest and highest of each column of the mask first: neighbouring cells share them.
            ends.clear();
            ends.resize(width, [1.0, 0.0]);
            for y in range(row, down, mask.height as usize) {
                for ([low, high], &share) in ends.iter_mut().zip(&mask.share[y * width..][..width]) {
                    (*low, *high) = (low.min(share), high.max(share));
                }
            }
            cells.extend((0..across).map(|column| {
                let ends = &ends[range(column, across, width)];
                let [low, high] = ends.iter().fold([1.0f32, 0.0f32], |a, b| [a[0].min(b[0]), a[1].max(b[1])]);
                match () {
                    () if low > SURE => Cell::Near,
                    () if high < 1.0 - SURE => Cell::Far,
                    () => Cell::Band,
                }
            }));
        }
    }

    /// The colours of the cells that are in the band, or in reach of it.
    #[inline(always)]
    pub fn gather(&self, cells: &[Cell], wanted: &mut Vec<bool>, sums: &mut Vec<Sums>) {
        let (across, down) = (self.across, self.down);
        sums.clear();
        sums.resize(across * down, Sums::NONE);
        wanted.clear();
        wanted.resize(across * down, false);
        for row in 0..down {
            for column in (0..across).filter(|column| cells[row * across + column] == Cell::Band) {
                for row in row.saturating_sub(REACH)..(row + REACH + 1).min(down) {
                    let columns = column.saturating_sub(REACH)..(column + REACH + 1).min(across);
                    wanted[row * across..][columns].fill(true);
                }
            }
        }
        for row in 0..down {
            for y in self.rows_of(row) {
                let (share_at, first) = (self.shares_in(y), y * self.color.width as usize);
                for column in (0..across).filter(|column| wanted[row * across + column]) {
                    let (sums, cell) = (&mut sums[row * across + column], cells[row * across + column]);
                    // Every other one is enough.
                    for x in self.columns_of(column).filter(|x| (x + y) % 2 == 0) {
                        match cell {
                            Cell::Near => sums.add(NEAR, self.light_at(first + x)),
                            Cell::Far => sums.add(FAR, self.light_at(first + x)),
                            Cell::Band => match share_at(x) {
                                share if share > SURE => sums.add(NEAR, self.light_at(first + x)),
                                share if share < 1.0 - SURE => sums.add(FAR, self.light_at(first + x)),
                                _ => {}
                            },
                        }
                    }
                }
            }
        }
    }

    /// How the colours around a cell differ; `None` where one of the surfaces has none.
    #[inline(always)]
    pub fn contrast(&self, kernel: &Kernel, sums: &[Sums], (row, column): (usize, usize)) -> Option<Contrast> {
        let mut around = Sums::NONE;
        for other_row in row.saturating_sub(REACH)..(row + REACH + 1).min(self.down) {
            let weights = &kernel[other_row + REACH - row];
            for other in column.saturating_sub(REACH)..(column + REACH + 1).min(self.across) {
                around.add_all(&sums[other_row * self.across + other], weights[other + REACH - column]);
            }
        }
        around.colors(self.backdrop.is_some()).map(Contrast::of)
    }

    /// The cells up to so many away from one, and itself.
    pub fn around(&self, at: usize, reach: usize) -> impl Iterator<Item = usize> + use<> {
        let (across, row, column) = (self.across, at / self.across, at % self.across);
        let columns = column.saturating_sub(reach)..(column + reach + 1).min(across);
        let rows = row.saturating_sub(reach)..(row + reach + 1).min(self.down);
        rows.flat_map(move |row| columns.clone().map(move |column| row * across + column))
    }
}
