//! The discrete Fourier transform of pictures.

use std::sync::Arc;

use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlanner};

/// Transforms planes of one size. Plane: row-major; spectrum: the transpose, so one row per horizontal frequency.
#[derive(Clone)]
pub struct Fourier {
    /// Columns and rows of a plane.
    pub width: usize,
    /// See `width`.
    pub height: usize,
    /// Along rows and along columns, forwards.
    forward: [Arc<dyn Fft<f32>>; 2],
    /// The same, backwards.
    inverse: [Arc<dyn Fft<f32>>; 2],
}

impl Fourier {
    /// Plans transforms of `width` x `height` values.
    pub fn new(width: usize, height: usize) -> Self {
        let mut planner = FftPlanner::new();
        let forward = [width, height].map(|length| planner.plan_fft_forward(length));
        let inverse = [width, height].map(|length| planner.plan_fft_inverse(length));
        Self { width, height, forward, inverse }
    }

    /// Transforms a plane to its spectrum.
    pub fn transform(&self, mut plane: Vec<Complex32>) -> Vec<Complex32> {
        self.forward[0].process(&mut plane);
        let mut spectrum = transpose(&plane, self.width);
        self.forward[1].process(&mut spectrum);
        spectrum
    }

    /// Transforms a spectrum back to its plane. Two spectra of real planes share a transform: `A + iB` becomes `a + ib`.
    pub fn invert(&self, mut spectrum: Vec<Complex32>) -> Vec<Complex32> {
        self.inverse[1].process(&mut spectrum);
        let mut plane = transpose(&spectrum, self.height);
        self.inverse[0].process(&mut plane);
        let scale = 1.0 / (self.width * self.height) as f32;
        plane.iter_mut().for_each(|value| *value *= scale);
        plane
    }

    /// Returns for each value of a spectrum what `of` says of its horizontal and vertical frequency, in cycles per pixel.
    pub fn map_frequencies<T>(&self, of: impl Fn(f32, f32) -> T) -> Vec<T> {
        let frequency = |k: usize, length: usize| {
            let k = if 2 * k < length { k as f32 } else { k as f32 - length as f32 };
            k / length as f32
        };
        let columns = 0..self.width;
        columns
            .flat_map(|x| (0..self.height).map(move |y| (x, y)))
            .map(|(x, y)| of(frequency(x, self.width), frequency(y, self.height)))
            .collect()
    }
}

/// Returns the transpose of a matrix with rows of `width` values, block by block, as caches like it.
fn transpose(from: &[Complex32], width: usize) -> Vec<Complex32> {
    const BLOCK: usize = 16;
    let height = from.len() / width;
    let mut to = vec![Complex32::default(); from.len()];
    for top in (0..height).step_by(BLOCK) {
        for left in (0..width).step_by(BLOCK) {
            for y in top..(top + BLOCK).min(height) {
                for x in left..(left + BLOCK).min(width) {
                    to[x * height + y] = from[y * width + x];
                }
            }
        }
    }
    to
}
