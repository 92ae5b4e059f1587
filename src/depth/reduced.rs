//! Downsampled pictures in the square root of linear light: exposure and white balance are factors there, and noise is
//! nearly uniform.

use std::iter::StepBy;
use std::ops::Range;

use pulp::{Arch, WithSimd};

use crate::color::srgb_to_linear_table;
use crate::frame::ColorImage;

/// Approximate number of columns of a reduced picture.
const COLUMNS: u32 = 320;
/// Largest value; values start at 0.
pub const MAX_VALUE: f32 = 255.0;

/// Reduces pictures.
#[derive(Debug)]
pub struct Reducer {
    /// Square roots by code; one entry more, so that interpolation always has a next one.
    roots: Box<[f32; 257]>,
    /// Sums of the codes in a row of blocks, per column.
    sums: Vec<u16>,
}

impl Default for Reducer {
    fn default() -> Self {
        let light = srgb_to_linear_table();
        let roots = Box::new(std::array::from_fn(|code| MAX_VALUE * light[code.min(255)].sqrt()));
        Self { roots, sums: Vec::new() }
    }
}

/// Returns the side in pixels of a block, which becomes one pixel, for pictures of this width.
pub fn block_px(width: u32) -> usize {
    ((width + COLUMNS / 2) / COLUMNS).max(1) as usize
}

/// Returns columns and rows of a reduced picture.
pub fn reduced_size(color: &ColorImage) -> (usize, usize) {
    let block_px = block_px(color.width);
    ((color.width as usize).div_ceil(block_px), (color.height as usize).div_ceil(block_px))
}

impl Reducer {
    /// Returns the square root of the linear light of a code, 0 to 255, scaled to [`MAX_VALUE`].
    #[inline(always)]
    pub fn sqrt_light(&self, code: f32) -> f32 {
        let first = code as u8;
        let [a, b] = [self.roots[usize::from(first)], self.roots[usize::from(first) + 1]];
        a + (b - a) * (code - f32::from(first))
    }

    /// Inverts [`Reducer::sqrt_light`].
    #[inline(always)]
    fn code_from_sqrt(&self, root: f32) -> f32 {
        let next = self.roots[1..256].partition_point(|&other| other <= root) + 1;
        let [a, b] = [self.roots[next - 1], self.roots[next]];
        if b > a { (next - 1) as f32 + ((root - a) / (b - a)).min(1.0) } else { 255.0 }
    }

    /// Returns the code before multiplication of its root by `gain`.
    #[inline(always)]
    pub fn without_gain(&self, code: u8, gain: f32) -> u8 {
        (self.code_from_sqrt((self.sqrt_light(f32::from(code)) / gain).min(MAX_VALUE)) + 0.5) as u8
    }

    /// Computes the linear light of each code, by channel, after multiplication of the root by a gain per channel.
    pub fn fill_exposure_tables(&self, gain: [f32; 3], light: &mut [[f32; 256]; 3]) {
        for (light, gain) in light.iter_mut().zip(gain) {
            // The gain applies to roots of light.
            let exposed = |code: usize| (gain * self.sqrt_light(code as f32) / MAX_VALUE).powi(2).min(1.0);
            light.iter_mut().enumerate().for_each(|(code, light)| *light = exposed(code));
        }
    }

    /// Computes the block means of a picture.
    pub fn reduce(&mut self, color: &ColorImage, reduced: &mut Vec<[f32; 3]>) {
        self.reduce_rows(color, (0..reduced_size(color).1).step_by(1), reduced);
    }

    /// Computes some rows of the block means of a picture; the other rows of `reduced` stay.
    pub fn reduce_rows(&mut self, color: &ColorImage, rows: StepBy<Range<usize>>, reduced: &mut Vec<[f32; 3]>) {
        let (across, down) = reduced_size(color);
        reduced.resize(across * down, [0.0; 3]);
        Arch::new().dispatch(ReduceRows { reducer: self, color, rows, reduced });
    }

    #[inline(always)]
    fn reduce_row(&mut self, color: &ColorImage, block_px: usize, row: usize, reduced: &mut [[f32; 3]]) {
        let (width, height) = (color.width as usize, color.height as usize);
        let lines = row * block_px..((row + 1) * block_px).min(height);
        self.sums.clear();
        self.sums.resize(3 * width, 0);
        // Sums the rows of the blocks first, which is vector code.
        for y in lines.clone() {
            for (sum, &code) in self.sums.iter_mut().zip(&color.rgb[3 * y * width..]) {
                *sum += u16::from(code);
            }
        }
        for (block, roots) in reduced.iter_mut().enumerate() {
            let columns = block * block_px..((block + 1) * block_px).min(width);
            let weight = 1.0 / (columns.len() * lines.len()) as f32;
            let mut sums = [0; 3];
            for pixel in &self.sums.as_chunks::<3>().0[columns] {
                for p in 0..3 {
                    sums[p] += u32::from(pixel[p]);
                }
            }
            for p in 0..3 {
                roots[p] = self.sqrt_light(sums[p] as f32 * weight);
            }
        }
    }
}

/// See [`Reducer::reduce_rows`].
struct ReduceRows<'a> {
    reducer: &'a mut Reducer,
    color: &'a ColorImage,
    rows: StepBy<Range<usize>>,
    reduced: &'a mut [[f32; 3]],
}

impl WithSimd for ReduceRows<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { reducer, color, rows, reduced } = self;
        let (block_px, (across, _)) = (block_px(color.width), reduced_size(color));
        for row in rows {
            reducer.reduce_row(color, block_px, row, &mut reduced[row * across..][..across]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_of_one_colour_have_it_in_every_size() {
        for (width, height) in [(7, 5), (320, 180), (641, 33), (1280, 720)] {
            let mut picture = ColorImage::new(width, height);
            picture.rgb.fill(100);
            let (mut reducer, mut reduced) = (Reducer::default(), Vec::new());
            reducer.reduce(&picture, &mut reduced);
            let (across, down) = reduced_size(&picture);
            assert_eq!(reduced.len(), across * down);
            assert!(
                across <= 480
                    && reduced.iter().flatten().all(|&value| (value - reducer.sqrt_light(100.0)).abs() < 1e-3)
            );
        }
    }
}
