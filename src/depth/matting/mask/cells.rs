//! Cells of a picture: their trimap label from the mask, and the colours of both surfaces around.

use std::ops::Range;

use pulp::Simd;

use super::BackgroundPlate;
use crate::depth::matting::contrast::{Color, Contrast};
use crate::depth::matting::symmetric::{Symmetric, outer_product};
use crate::depth::tap::Tap;
use crate::frame::{ColorImage, Mask};

/// Mask value from which a pixel is surely near; below 1 minus this, it is surely far.
const SURE: f32 = 0.95;
/// Radius in cells within which colours are gathered.
pub const RADIUS: usize = 5;
/// Minimum weight of a surface's pixels for its colour to be known.
const MIN_WEIGHT: f32 = 0.5;

/// Variance of a background picture's light: noise, and half a pixel of shift.
const NOISE: f32 = 2e-4;

/// Weights of the cells around one, by row and column.
pub type Kernel = [[f32; 2 * RADIUS + 1]; 2 * RADIUS + 1];

/// Trimap label of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cell {
    Near,
    Far,
    /// The unknown region: mask undecided, in the cell or beside it.
    Band,
}

/// Sums over the pixels of both surfaces in a cell, [`SURFACE`] numbers each: count, light, products of light.
#[derive(Clone, Copy, Debug)]
pub struct Sums([f32; 2 * SURFACE]);

/// Numbers per surface: padded from ten to whole vectors.
const SURFACE: usize = 12;
/// Indices of the near and the far surface.
const NEAR: usize = 0;
const FAR: usize = 1;

impl Sums {
    const NONE: Self = Self([0.0; 2 * SURFACE]);

    #[inline(always)]
    fn add(&mut self, surface: usize, light: [f32; 3]) {
        let sums = &mut self.0[surface * SURFACE..][..SURFACE];
        let [xx, xy, xz, yy, yz, zz] = outer_product(light);
        let values = [1.0, light[0], light[1], light[2], xx, xy, xz, yy, yz, zz, 0.0, 0.0];
        sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
    }

    // Explicit vectors: the compiler unrolls the loop over all numbers instead, one at a time.
    #[inline(always)]
    fn add_weighted<S: Simd>(&mut self, simd: S, other: &Self, weight: f32) {
        let ((sums, last), (others, last_others)) = (S::as_mut_simd_f32s(&mut self.0), S::as_simd_f32s(&other.0));
        let weights = simd.splat_f32s(weight);
        for (sum, &value) in sums.iter_mut().zip(others) {
            *sum = simd.add_f32s(*sum, simd.mul_f32s(weights, value));
        }
        for (sum, value) in last.iter_mut().zip(last_others) {
            *sum += weight * value;
        }
    }

    /// Returns both surfaces' colours; `None` if one has too few pixels. With a known background, the far colour is just its
    /// noise.
    fn colors(&self, is_background_known: bool) -> Option<[Color; 2]> {
        let noise = Color { mean: [0.0; 3], covariance: [NOISE, 0.0, 0.0, NOISE, 0.0, NOISE] };
        let weights = [self.0[0], self.0[SURFACE]];
        let color = |k: usize| {
            let sums = &self.0[k * SURFACE + 1..];
            let squares: Symmetric = std::array::from_fn(|k| sums[3 + k]);
            Color::from_sums(weights[k], std::array::from_fn(|k| sums[k]), squares)
        };
        match weights.map(|weight| weight > MIN_WEIGHT) {
            [true, _] if is_background_known => Some([color(NEAR), noise]),
            [true, true] => Some([color(NEAR), color(FAR)]),
            _ => None,
        }
    }
}

/// The input of matting, and the layout of its cells.
pub struct MaskView<'a> {
    pub mask: &'a Mask,
    /// A mask as large as the picture, for where colours say nothing.
    pub given: Option<&'a Mask>,
    pub color: &'a ColorImage,
    pub light: &'a [f32; 256],
    pub backdrop: Option<&'a BackgroundPlate<'a>>,
    /// Per column of the picture, the mask columns on both sides.
    pub columns: &'a [Tap],
    pub cell_px: usize,
    pub across: usize,
    pub down: usize,
}

impl MaskView<'_> {
    /// Returns the pixel columns of a column of cells.
    #[inline(always)]
    pub fn pixel_columns(&self, column: usize) -> Range<usize> {
        column * self.cell_px..((column + 1) * self.cell_px).min(self.color.width as usize)
    }

    /// Returns the pixel rows of a row of cells.
    #[inline(always)]
    pub fn pixel_rows(&self, row: usize) -> Range<usize> {
        row * self.cell_px..((row + 1) * self.cell_px).min(self.color.height as usize)
    }

    /// Returns the linear light of a pixel.
    #[inline(always)]
    pub fn light_at(&self, at: usize) -> [f32; 3] {
        [0, 1, 2].map(|p| self.light[usize::from(self.color.rgb[3 * at + p])])
    }

    /// Returns a function from the column to the mask value in a row of pixels, bilinearly interpolated.
    #[inline(always)]
    pub fn mask_in_row(&self, y: usize) -> impl Fn(usize) -> f32 {
        let width = self.mask.width as usize;
        let Tap { first, second, weight } = Tap::new(y, self.color.height as usize, self.mask.height as usize);
        let row = |row: usize| &self.mask.alpha[row * width..][..width];
        let (above, below, columns) = (row(first), row(second), self.columns);
        move |x| {
            let across = &columns[x];
            let between = |row: &[f32]| row[across.first] + (row[across.second] - row[across.first]) * across.weight;
            let above = between(above);
            above + (between(below) - above) * weight
        }
    }

    /// Computes the trimap label of each cell. `ends` is scratch memory.
    #[inline(always)]
    pub fn classify_cells(&self, cells: &mut Vec<Cell>, ends: &mut Vec<[f32; 2]>) {
        let (across, down, mask) = (self.across, self.down, self.mask);
        let range = |of: usize, count: usize, side: usize| {
            // The mask pixels of a cell plus one on each side: the unknown region is up to a cell wider than necessary.
            let scale = side as f32 / count as f32;
            let start = (of as f32 * scale - 1.0).max(0.0) as usize;
            start.min(side - 1)..(((of + 1) as f32 * scale + 1.0).ceil() as usize).min(side)
        };
        let width = mask.width as usize;
        cells.clear();
        for row in 0..down {
            // Column-wise extremes first, since neighbouring cells share them.
            ends.clear();
            ends.resize(width, [1.0, 0.0]);
            for y in range(row, down, mask.height as usize) {
                for ([low, high], &alpha) in ends.iter_mut().zip(&mask.alpha[y * width..][..width]) {
                    (*low, *high) = (low.min(alpha), high.max(alpha));
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

    /// Gathers the colours of the cells in the unknown region, and within [`RADIUS`] of it.
    #[inline(always)]
    pub fn gather_colors(&self, cells: &[Cell], needed: &mut Vec<bool>, sums: &mut Vec<Sums>) {
        let (across, down) = (self.across, self.down);
        sums.clear();
        sums.resize(across * down, Sums::NONE);
        needed.clear();
        needed.resize(across * down, false);
        for row in 0..down {
            for column in (0..across).filter(|column| cells[row * across + column] == Cell::Band) {
                for row in row.saturating_sub(RADIUS)..(row + RADIUS + 1).min(down) {
                    let columns = column.saturating_sub(RADIUS)..(column + RADIUS + 1).min(across);
                    needed[row * across..][columns].fill(true);
                }
            }
        }
        for row in 0..down {
            for y in self.pixel_rows(row) {
                let (alpha_at, first) = (self.mask_in_row(y), y * self.color.width as usize);
                for column in (0..across).filter(|column| needed[row * across + column]) {
                    let (sums, cell) = (&mut sums[row * across + column], cells[row * across + column]);
                    // Every other pixel suffices.
                    for x in self.pixel_columns(column).filter(|x| (x + y) % 2 == 0) {
                        match cell {
                            Cell::Near => sums.add(NEAR, self.light_at(first + x)),
                            Cell::Far => sums.add(FAR, self.light_at(first + x)),
                            Cell::Band => match alpha_at(x) {
                                alpha if alpha > SURE => sums.add(NEAR, self.light_at(first + x)),
                                alpha if alpha < 1.0 - SURE => sums.add(FAR, self.light_at(first + x)),
                                _ => {}
                            },
                        }
                    }
                }
            }
        }
    }

    /// Computes the colour contrast around a cell; `None` if a surface has too few pixels.
    #[inline(always)]
    pub fn compute_contrast<S: Simd>(
        &self,
        simd: S,
        kernel: &Kernel,
        sums: &[Sums],
        (row, column): (usize, usize),
    ) -> Option<Contrast> {
        let mut around = Sums::NONE;
        for other_row in row.saturating_sub(RADIUS)..(row + RADIUS + 1).min(self.down) {
            let weights = &kernel[other_row + RADIUS - row];
            for other in column.saturating_sub(RADIUS)..(column + RADIUS + 1).min(self.across) {
                let sums = &sums[other_row * self.across + other];
                around.add_weighted(simd, sums, weights[other + RADIUS - column]);
            }
        }
        around.colors(self.backdrop.is_some()).map(Contrast::new)
    }

    /// Iterates over the cells within `radius` of a cell, including itself.
    pub fn cells_within(&self, at: usize, radius: usize) -> impl Iterator<Item = usize> + use<> {
        let (across, row, column) = (self.across, at / self.across, at % self.across);
        let columns = column.saturating_sub(radius)..(column + radius + 1).min(across);
        let rows = row.saturating_sub(radius)..(row + radius + 1).min(self.down);
        rows.flat_map(move |row| columns.clone().map(move |column| row * across + column))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct AddWeighted<'a>(&'a mut Sums, &'a [(Sums, f32)]);

    impl pulp::WithSimd for AddWeighted<'_> {
        type Output = ();
        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            self.1.iter().for_each(|(sums, weight)| self.0.add_weighted(simd, sums, *weight));
        }
    }

    #[test]
    fn weighted_sums_are_the_same_to_the_bit_with_any_vectors() {
        let cells: Vec<(Sums, f32)> = (0..121)
            .map(|cell| (Sums(std::array::from_fn(|k| (cell * 31 + k * 17) as f32 / 7.0)), 1.0 / (1 + cell) as f32))
            .collect();
        let mut expected = [0.0; 2 * SURFACE];
        for (sums, weight) in &cells {
            expected.iter_mut().zip(sums.0).for_each(|(sum, value)| *sum += weight * value);
        }
        for arch in [pulp::Arch::Scalar, pulp::Arch::new()] {
            let mut around = Sums::NONE;
            arch.dispatch(AddWeighted(&mut around, &cells));
            assert_eq!(around.0, expected);
        }
    }
}
