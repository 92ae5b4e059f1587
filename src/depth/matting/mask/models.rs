//! Colour models of cells: the colours of both surfaces around, and how well they can be separated.

#![allow(clippy::needless_range_loop)] // Numbers index several arrays at once.

use pulp::Simd;

use super::cells::{Cell, MaskView, SURE};
use crate::depth::bitmap::{Bitmap, set_bits};
use crate::depth::matting::contrast::{Color, Contrast};
use crate::depth::matting::symmetric::{Symmetric, outer_product};
use crate::depth::tap::Tap;

/// Radius in cells within which colours are averaged.
const RADIUS: usize = 5;
/// Distance, in cells, at which the weight of a cell falls to an eighth.
const FALLOFF_CELLS: f32 = 1.5;
/// Minimum weight of a surface's pixels for its colour to be known.
const MIN_WEIGHT: f32 = 0.5;
/// Variance of a background picture's light: noise, and half a pixel of shift.
const NOISE: f32 = 2e-4;

/// Columns of pixels from one sample of colour to the next.
const STEP: usize = 2;
/// Columns on both sides of a cell that are within [`RADIUS`], by distance in rows.
const HALVES: [usize; RADIUS + 1] = {
    let (mut halves, mut row) = ([0; RADIUS + 1], 0);
    while row <= RADIUS {
        halves[row] = (RADIUS * RADIUS - row * row).isqrt();
        row += 1;
    }
    halves
};

/// Weights of the cells around one, by row and column.
type Kernel = [[f32; 2 * RADIUS + 1]; 2 * RADIUS + 1];

/// Sums over the pixels of both surfaces in a cell, [`SURFACE`] numbers each: count, light, products of light.
#[derive(Clone, Copy, Debug)]
struct Sums([f32; 2 * SURFACE]);

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

    /// Returns both surfaces' colours; `None` if one has too few pixels. With a known background, the far colour is
    /// just its noise.
    #[inline(always)]
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

/// Numbers of a [`Model`].
pub const MODEL: usize = 24;
/// Where its parts begin: direction, offset and precision of the discriminant; mean and variance of both surfaces, near
/// mean first, variances last; inverse of the scatter within the surfaces.
pub const LINE: usize = 0;
pub const SURFACES: usize = 8;
pub const INVERSE: usize = 16;
const PRECISION: usize = LINE + 4;

/// The colour model of a cell, as numbers that are interpolated between cells, padded to whole vectors.
pub type Model = [f32; MODEL];

#[inline(always)]
fn model_of(contrast: &Contrast) -> Model {
    let mut model = [0.0; MODEL];
    model[LINE..][..5].copy_from_slice(&contrast.discriminant_params());
    model[SURFACES..][..8].copy_from_slice(&contrast.surface_params());
    model[INVERSE..][..6].copy_from_slice(&contrast.foreground_params()[3..]);
    model
}

/// The models of the cells in and beside the unknown region; owns the memory for them.
#[derive(Debug)]
pub struct Models {
    kernel: Kernel,
    /// Whether a cell is in or beside the unknown region: only these have sums and models.
    needed: Bitmap,
    sums: Vec<Sums>,
    models: Vec<Model>,
    /// Whether a cell's model is of the colours around; if not, it is that of a neighbour, with precision 0, so that it
    /// weighs less the closer it is.
    is_known: Vec<bool>,
    columns: Vec<usize>,
    mask_row: Vec<f32>,
}

impl Default for Models {
    fn default() -> Self {
        let weight = |row: usize, column: usize| {
            let square = (row.abs_diff(RADIUS).pow(2) + column.abs_diff(RADIUS).pow(2)) as f32;
            (1.0 + square / (FALLOFF_CELLS * FALLOFF_CELLS)).powi(-3)
        };
        Self {
            kernel: std::array::from_fn(|row| std::array::from_fn(|column| weight(row, column))),
            needed: Bitmap::default(),
            sums: Vec::new(),
            models: Vec::new(),
            is_known: Vec::new(),
            columns: Vec::new(),
            mask_row: Vec::new(),
        }
    }
}

impl Models {
    /// Forgets all models, so that nothing is known of the colours around any cell.
    pub fn clear(&mut self, cells: usize) {
        self.is_known.clear();
        self.is_known.resize(cells, false);
    }

    /// Computes the models of the cells in and beside the unknown region. Colours of the cells there suffice: those
    /// further away hardly have weight.
    #[inline(always)]
    pub fn fit<S: Simd>(&mut self, simd: S, view: &MaskView, cells: &[Cell]) {
        view.mark_around_band(cells, 1, &mut self.needed);
        // Only needed cells are read, so that the rest may have any value.
        self.sums.resize(cells.len(), Sums::NONE);
        self.models.resize(cells.len(), [0.0; MODEL]);
        for row in 0..view.down {
            self.select_columns(row, view.across);
            self.gather_colors(view, cells, row);
        }
        for row in 0..view.down {
            self.select_columns(row, view.across);
            for k in 0..self.columns.len() {
                let column = self.columns[k];
                let colors = self.sum_around(simd, view, (row, column)).colors(view.backdrop.is_some());
                if let Some(colors) = colors {
                    let at = row * view.across + column;
                    (self.models[at], self.is_known[at]) = (model_of(&Contrast::new(colors)), true);
                }
            }
        }
        for row in 0..view.down {
            self.select_columns(row, view.across);
            for at in self.columns.iter().map(|column| row * view.across + column) {
                if !self.is_known[at] {
                    let other = view.cells_within(at, 1).find(|&other| self.is_known[other]);
                    self.models[at] = other.map_or([0.0; MODEL], |other| self.models[other]);
                    self.models[at][PRECISION] = 0.0;
                }
            }
        }
    }

    /// Lists the needed cells of a row.
    fn select_columns(&mut self, row: usize, across: usize) {
        self.columns.clear();
        for first in (0..across).step_by(crate::depth::bitmap::WORD) {
            self.columns.extend(set_bits(self.needed.word_at(first, row)).map(|place| first + place));
        }
    }

    /// Gathers the colours of the selected cells of a row.
    #[inline(always)]
    fn gather_colors(&mut self, view: &MaskView, cells: &[Cell], row: usize) {
        let Self { sums, columns, mask_row, .. } = self;
        let (cells, sums) = (&cells[row * view.across..], &mut sums[row * view.across..]);
        columns.iter().for_each(|&column| sums[column] = Sums::NONE);
        for y in view.pixel_rows(row) {
            if columns.is_empty() {
                return;
            }
            let first = y * view.color.width as usize;
            view.interpolate_mask_row(y, mask_row);
            for &column in &*columns {
                // Of the pixels, one in two suffices; of pure cells, one in four.
                let (pure, row) = match cells[column] {
                    Cell::Band => (None, y),
                    _ if y % 2 == 1 => continue,
                    Cell::Near => (Some(1.0), y / 2),
                    Cell::Far => (Some(0.0), y / 2),
                };
                let (sums, xs) = (&mut sums[column], view.pixel_columns(column));
                for x in (xs.start + row % STEP..xs.end).step_by(STEP) {
                    let light = view.light_at(first + x);
                    match pure.unwrap_or_else(|| view.mask_at(mask_row, x)) {
                        alpha if alpha > SURE => sums.add(NEAR, light),
                        alpha if alpha < 1.0 - SURE => sums.add(FAR, light),
                        _ => {}
                    }
                }
            }
        }
        // These count twice.
        for &column in columns.iter().filter(|column| cells[**column] != Cell::Band) {
            sums[column].0.iter_mut().for_each(|sum| *sum *= 2.0);
        }
    }

    /// Returns the weighted sums of the cells around one.
    #[inline(always)]
    fn sum_around<S: Simd>(&self, simd: S, view: &MaskView, (row, column): (usize, usize)) -> Sums {
        let mut around = Sums::NONE;
        for other_row in row.saturating_sub(RADIUS)..(row + RADIUS + 1).min(view.down) {
            let (weights, half) = (&self.kernel[other_row + RADIUS - row], HALVES[other_row.abs_diff(row)]);
            let columns = column.saturating_sub(half)..(column + half + 1).min(view.across);
            let within = (1 << columns.len()) - 1;
            for place in set_bits(self.needed.word_at(columns.start, other_row) & within) {
                let other = columns.start + place;
                let sums = &self.sums[other_row * view.across + other];
                around.add_weighted(simd, sums, weights[other + RADIUS - column]);
            }
        }
        around
    }

    /// Returns the part from `first` on of the models left and right of some pixels, interpolated vertically; `None` if
    /// none of the four cells knows its colours.
    #[inline(always)]
    pub fn beside<const N: usize>(
        &self,
        first: usize,
        across: usize,
        down: &Tap,
        columns: [usize; 2],
    ) -> Option<[[f32; N]; 2]> {
        let (above, below) = (down.first * across, down.second * across);
        let cells = [[above + columns[0], below + columns[0]], [above + columns[1], below + columns[1]]];
        if !cells.as_flattened().iter().any(|&cell| self.is_known[cell]) {
            return None;
        }
        let mut sides = [[0.0; N]; 2];
        for (side, [above, below]) in sides.iter_mut().zip(cells) {
            let (above, below) = (&self.models[above][first..][..N], &self.models[below][first..][..N]);
            for k in 0..N {
                side[k] = above[k] + (below[k] - above[k]) * down.weight;
            }
        }
        Some(sides)
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
