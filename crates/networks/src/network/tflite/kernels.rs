//! Operators on pictures in blocks of channels: one vector of channels per pixel, pixels in order. A step along a row
//! is then one vector, whatever the number of channels (nChw8c layout of oneDNN).

use pulp::{Simd, WithSimd};

use super::model::{Activation, Strides};
use bokehcam::compute::simd::{fma, load};

/// A picture's size and memory layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    pub rows: usize,
    pub columns: usize,
    pub channels: usize,
    /// Channels per block; unused channels of the last one are ignored or meet weights of 0.
    pub lanes: usize,
}

impl Size {
    pub fn blocks(&self) -> usize {
        self.channels.div_ceil(self.lanes)
    }

    pub fn pixels(&self) -> usize {
        self.rows * self.columns
    }

    /// Returns the size with twice the rows and columns.
    pub fn doubled(self) -> Self {
        Self { rows: 2 * self.rows, columns: 2 * self.columns, ..self }
    }

    /// Returns the number of values in memory.
    pub fn len(&self) -> usize {
        self.blocks() * self.plane()
    }

    /// Returns the values per block.
    pub fn plane(&self) -> usize {
        self.pixels() * self.lanes
    }
}

/// A filter on one axis: number of taps, stride, and padding before the first pixel.
#[derive(Clone, Copy, Debug)]
pub struct Axis {
    pub taps: usize,
    pub step: usize,
    pub padding: usize,
}

impl Axis {
    /// Creates the axis of a filter; returns it with the number of outputs for `pixels` inputs.
    fn new(taps: usize, step: usize, is_padded: bool, pixels: usize) -> Option<(Self, usize)> {
        let count = if is_padded { pixels.div_ceil(step) } else { pixels.checked_sub(taps)? / step + 1 };
        let outside = (count.checked_sub(1)? * step + taps).saturating_sub(pixels);
        Some((Self { taps, step, padding: if is_padded { outside / 2 } else { 0 } }, count))
    }

    /// Returns the taps of output `at` that lie within the picture, and the pixel under the first of them.
    pub fn taps_inside(&self, at: usize, pixels: usize) -> (std::ops::Range<usize>, usize) {
        let first = at * self.step;
        let from = self.padding.saturating_sub(first);
        let to = (pixels + self.padding).saturating_sub(first).min(self.taps);
        (from..to.max(from), (first + from).saturating_sub(self.padding))
    }

    /// Returns the length of a line with padding, for `results` outputs.
    pub fn padded_len(&self, pixels: usize, results: usize) -> usize {
        (self.padding + pixels).max((results - 1) * self.step + self.taps)
    }
}

/// Returns the axes of a filter over a picture, and the rows and columns of its output.
pub fn filter_axes(size: &Size, [down, across]: [usize; 2], steps: &Strides) -> Option<([Axis; 2], [usize; 2])> {
    let (down, rows) = Axis::new(down, steps.down, steps.is_padded, size.rows)?;
    let (across, columns) = Axis::new(across, steps.across, steps.is_padded, size.columns)?;
    Some(([down, across], [rows, columns]))
}

/// Views values as vectors; there is no remainder, as every picture consists of whole vectors.
#[inline(always)]
pub fn as_vectors<S: Simd>(values: &[f32]) -> &[S::f32s] {
    S::as_simd_f32s(values).0
}

#[inline(always)]
pub fn as_vectors_mut<S: Simd>(values: &mut [f32]) -> &mut [S::f32s] {
    S::as_mut_simd_f32s(values).0
}

#[inline(always)]
pub fn activate<S: Simd>(simd: S, activation: Activation, sum: S::f32s) -> S::f32s {
    let zero = simd.splat_f32s(0.0);
    match activation {
        // Logistic is rare except at the mask: a separate pass computes it.
        Activation::None | Activation::Logistic => sum,
        Activation::Relu => simd.max_f32s(sum, zero),
        Activation::HardSwish => {
            let gate = simd.add_f32s(sum, simd.splat_f32s(3.0));
            let gate = simd.min_f32s(simd.max_f32s(gate, zero), simd.splat_f32s(6.0));
            simd.mul_f32s(simd.mul_f32s(sum, gate), simd.splat_f32s(1.0 / 6.0))
        }
    }
}

/// Applies 1 / (1 + exp(-x)) to each value.
pub struct Logistic<'a> {
    pub values: &'a mut [f32],
}

impl WithSimd for Logistic<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for value in self.values {
            *value = 1.0 / (1.0 + fast_exp(-*value));
        }
    }
}

/// Computes exp(x) with a relative error of 2e-7: 2^n by the exponent bits, times a Taylor series of the remainder.
#[inline(always)]
fn fast_exp(x: f32) -> f32 {
    /// Adding it to a float below 2^22 rounds to an integer, which is then in the low bits.
    const WHOLE: f32 = 12_582_912.0;
    let power = (x * std::f32::consts::LOG2_E).clamp(-126.0, 126.0);
    let whole = power + WHOLE;
    let rest = (power - (whole - WHOLE)) * std::f32::consts::LN_2;
    let series = 1.0 + rest * (1.0 + rest * (0.5 + rest * (1.0 / 6.0 + rest * (1.0 / 24.0 + rest * (1.0 / 120.0)))));
    f32::from_bits(series.to_bits().wrapping_add(whole.to_bits() << 23))
}

/// Returns the number of channels per vector.
pub struct LaneCount;

impl WithSimd for LaneCount {
    type Output = usize;
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> usize {
        S::F32_LANES
    }
}

/// Elementwise `a * gate + b` with activation; `gate` has one value per channel.
pub struct Elementwise<'a> {
    pub a: &'a [f32],
    pub gate: Option<&'a [f32]>,
    pub b: Option<&'a [f32]>,
    pub activation: Activation,
    pub out: &'a mut [f32],
    /// Values per block.
    pub plane: usize,
}

impl WithSimd for Elementwise<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { a, gate, b, activation, out, plane } = self;
        let one = simd.splat_f32s(1.0);
        for (block, out) in out.chunks_exact_mut(plane).enumerate() {
            let a = as_vectors::<S>(&a[block * plane..][..plane]);
            let gate = gate.map_or(one, |gate| load::<S>(gate, block * S::F32_LANES));
            let out = as_vectors_mut::<S>(out).iter_mut().zip(a);
            match b {
                Some(b) => out.zip(as_vectors::<S>(&b[block * plane..][..plane])).for_each(|((out, a), b)| {
                    *out = activate(simd, activation, fma(simd, *a, gate, *b));
                }),
                None => out.for_each(|(out, a)| *out = activate(simd, activation, simd.mul_f32s(*a, gate))),
            }
        }
    }
}

/// The mean of each channel of a picture, or of the sum of two pictures.
pub struct Mean<'a> {
    pub a: &'a [f32],
    pub b: Option<&'a [f32]>,
    pub out: &'a mut [f32],
    pub plane: usize,
}

impl WithSimd for Mean<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let scale = simd.splat_f32s(S::F32_LANES as f32 / self.plane as f32);
        for (block, out) in as_vectors_mut::<S>(self.out).iter_mut().enumerate() {
            let mut sums = [simd.splat_f32s(0.0); 4];
            for values in [Some(self.a), self.b].into_iter().flatten() {
                for (k, pixel) in as_vectors::<S>(&values[block * self.plane..][..self.plane]).iter().enumerate() {
                    sums[k % 4] = simd.add_f32s(sums[k % 4], *pixel);
                }
            }
            let sum = simd.add_f32s(simd.add_f32s(sums[0], sums[1]), simd.add_f32s(sums[2], sums[3]));
            *out = simd.mul_f32s(sum, scale);
        }
    }
}

/// Bilinear upsampling to twice the size, with half-pixel centres.
pub struct Upsample<'a> {
    pub input: &'a [f32],
    pub size: Size,
    /// Working memory: one vertically interpolated row.
    pub row: &'a mut [f32],
    pub out: &'a mut [f32],
}

impl WithSimd for Upsample<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { input, size, row, out } = self;
        let length = size.columns * S::F32_LANES;
        let beside = |at: usize, count: usize| match at.is_multiple_of(2) {
            true => (at / 2).saturating_sub(1),
            false => (at / 2 + 1).min(count - 1),
        };
        let (three, one) = (simd.splat_f32s(0.75), simd.splat_f32s(0.25));
        let between = |near: S::f32s, far: S::f32s| fma(simd, near, three, simd.mul_f32s(far, one));
        for (input, out) in input.chunks_exact(size.plane()).zip(out.chunks_exact_mut(4 * size.plane())) {
            for (y, out) in out.chunks_exact_mut(2 * length).enumerate() {
                let line = |y: usize| as_vectors::<S>(&input[y * length..][..length]);
                let row = as_vectors_mut::<S>(row);
                for ((row, near), far) in row.iter_mut().zip(line(y / 2)).zip(line(beside(y, size.rows))) {
                    *row = between(*near, *far);
                }
                for (x, out) in as_vectors_mut::<S>(out).iter_mut().enumerate() {
                    *out = between(row[x / 2], row[beside(x, size.columns)]);
                }
            }
        }
    }
}
