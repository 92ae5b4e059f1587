//! The operators, on pictures whose pixels have their channels side by side, padded with zeros to whole [`PADDED`].

use pulp::{Simd, WithSimd};

use super::model::{Activation, Steps};
use crate::compute::simd::{fma, load, store};

/// Channels that a pixel has in memory are a multiple of this: whole vectors of any machine.
pub const PADDED: usize = 16;
/// Pixels of which sums are made at once: as many as there are registers for.
const AT_ONCE: usize = 8;

/// A picture's size, and how far its pixels are apart in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    pub rows: usize,
    pub columns: usize,
    pub channels: usize,
    pub stride: usize,
}

impl Size {
    /// Values in memory.
    pub fn len(&self) -> usize {
        self.rows * self.columns * self.stride
    }

    pub fn pixels(&self) -> usize {
        self.rows * self.columns
    }
}

/// A filter's taps on one axis: their number, the step, and how many lie before the first pixel.
#[derive(Clone, Copy, Debug)]
pub struct Axis {
    pub taps: usize,
    pub step: usize,
    pub before: usize,
}

impl Axis {
    /// Those of a filter, and how many results they make of so many pixels.
    pub fn new(taps: usize, step: usize, beyond: bool, pixels: usize) -> Option<(Self, usize)> {
        let count = if beyond { pixels.div_ceil(step) } else { pixels.checked_sub(taps)? / step + 1 };
        let outside = (count.checked_sub(1)? * step + taps).saturating_sub(pixels);
        Some((Self { taps, step, before: if beyond { outside / 2 } else { 0 } }, count))
    }

    /// The taps of a result that lie in the picture, and the pixel under the first of them.
    fn inside(&self, at: usize, pixels: usize) -> (std::ops::Range<usize>, usize) {
        let first = at * self.step;
        let from = self.before.saturating_sub(first);
        let to = (pixels + self.before - first).min(self.taps);
        (from..to.max(from), (first + from).saturating_sub(self.before))
    }
}

/// The axes of a filter over a picture, and the size of what it makes.
pub fn axes(size: &Size, [down, across]: [usize; 2], steps: &Steps) -> Option<([Axis; 2], [usize; 2])> {
    let (down, rows) = Axis::new(down, steps.down, steps.beyond, size.rows)?;
    let (across, columns) = Axis::new(across, steps.across, steps.beyond, size.columns)?;
    Some(([down, across], [rows, columns]))
}

#[inline(always)]
fn activated<S: Simd>(simd: S, activation: Activation, sum: S::f32s) -> S::f32s {
    let zero = simd.splat_f32s(0.0);
    match activation {
        // Logistic functions are few but those of the mask, and take a pass of their own.
        Activation::None | Activation::Logistic => sum,
        Activation::Relu => simd.max_f32s(sum, zero),
        Activation::HardSwish => {
            let gate = simd.add_f32s(sum, simd.splat_f32s(3.0));
            let gate = simd.min_f32s(simd.max_f32s(gate, zero), simd.splat_f32s(6.0));
            simd.mul_f32s(simd.mul_f32s(sum, gate), simd.splat_f32s(1.0 / 6.0))
        }
    }
}

/// 1 / (1 + exp(-x)).
#[inline(always)]
fn logistic(values: &mut [f32]) {
    for value in values {
        *value = 1.0 / (1.0 + exp(-*value));
    }
}

/// exp(x) to 2e-7 of itself: 2 to the power of a whole number, whose bits are the exponent's, and of a rest.
#[inline(always)]
fn exp(x: f32) -> f32 {
    /// Added to a float below 2^22, it leaves the nearest whole number in the last bits.
    const WHOLE: f32 = 12_582_912.0;
    let power = (x * std::f32::consts::LOG2_E).clamp(-126.0, 126.0);
    let whole = power + WHOLE;
    let rest = (power - (whole - WHOLE)) * std::f32::consts::LN_2;
    let series = 1.0 + rest * (1.0 + rest * (0.5 + rest * (1.0 / 6.0 + rest * (1.0 / 24.0 + rest * (1.0 / 120.0)))));
    f32::from_bits(series.to_bits().wrapping_add(whole.to_bits() << 23))
}

/// Sums over the channels of each pixel: `weights` are `[block of a vector's channels][depth][lane]`.
pub struct Pointwise<'a> {
    pub input: &'a [f32],
    pub apart: usize,
    pub depth: usize,
    pub weights: &'a [f32],
    pub bias: &'a [f32],
    pub activation: Activation,
    pub out: &'a mut [f32],
    pub stride: usize,
}

impl WithSimd for Pointwise<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let pixels = self.out.len() / self.stride;
        for block in 0..self.stride / S::F32_LANES {
            let whole = pixels / AT_ONCE * AT_ONCE;
            for first in (0..whole).step_by(AT_ONCE) {
                self.sums::<S, AT_ONCE>(simd, block, first);
            }
            for first in whole..pixels {
                self.sums::<S, 1>(simd, block, first);
            }
        }
        if self.activation == Activation::Logistic {
            logistic(self.out);
        }
    }
}

impl Pointwise<'_> {
    #[inline(always)]
    fn sums<S: Simd, const N: usize>(&mut self, simd: S, block: usize, first: usize) {
        let at = block * S::F32_LANES;
        let weights = &self.weights[at * self.depth..][..S::F32_LANES * self.depth];
        let pixels: [&[f32]; N] = std::array::from_fn(|k| &self.input[(first + k) * self.apart..][..self.depth]);
        let mut sums = [load::<S>(self.bias, at); N];
        for (channel, weights) in S::as_simd_f32s(weights).0.iter().enumerate() {
            for k in 0..N {
                sums[k] = fma(simd, simd.splat_f32s(pixels[k][channel]), *weights, sums[k]);
            }
        }
        for (k, sum) in sums.into_iter().enumerate() {
            store::<S>(self.out, (first + k) * self.stride + at, activated(simd, self.activation, sum));
        }
    }
}

/// How many channels a vector has.
pub struct Lanes;

impl WithSimd for Lanes {
    type Output = usize;
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> usize {
        S::F32_LANES
    }
}

/// The pixels under the filter of each result of a row, one after the other: then the filter is one over channels.
pub fn under_filter(input: &[f32], size: &Size, [down, across]: &[Axis; 2], row: usize, out: &mut [f32]) {
    let (rows, first_row) = down.inside(row, size.rows);
    let length = size.channels * across.taps;
    out.fill(0.0);
    for (x, out) in out.chunks_exact_mut(length * down.taps).enumerate() {
        let (columns, first) = across.inside(x, size.columns);
        for (y, tap) in (first_row..).zip(rows.clone()) {
            for (x, column) in (first..).zip(columns.clone()) {
                let pixel = &input[(y * size.columns + x) * size.stride..][..size.channels];
                out[tap * length + column * size.channels..][..size.channels].copy_from_slice(pixel);
            }
        }
    }
}

/// A filter for each channel: `weights` are `[tap][channel]`.
pub struct Depthwise<'a> {
    pub input: &'a [f32],
    pub size: Size,
    pub axes: [Axis; 2],
    pub weights: &'a [f32],
    pub bias: &'a [f32],
    pub activation: Activation,
    pub out: &'a mut [f32],
    pub columns: usize,
}

impl WithSimd for Depthwise<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { input, size, axes: [down, across], weights, bias, activation, out, columns } = self;
        let stride = size.stride;
        for (y, row) in out.chunks_exact_mut(columns * stride).enumerate() {
            let (taps_down, first_row) = down.inside(y, size.rows);
            for (x, pixel) in row.chunks_exact_mut(stride).enumerate() {
                let (taps_across, first) = across.inside(x, size.columns);
                for at in (0..stride).step_by(S::F32_LANES) {
                    let mut sum = load::<S>(bias, at);
                    for (y, tap) in (first_row..).zip(taps_down.clone()) {
                        let line = &input[(y * size.columns + first) * stride..][..taps_across.len() * stride];
                        let taps = &weights[(tap * across.taps + taps_across.start) * stride..][..line.len()];
                        for (from, weights) in line.chunks_exact(stride).zip(taps.chunks_exact(stride)) {
                            sum = fma(simd, load::<S>(from, at), load::<S>(weights, at), sum);
                        }
                    }
                    store::<S>(pixel, at, activated(simd, activation, sum));
                }
            }
        }
    }
}

/// What is done to each value by itself, or to two of the same place; `gate` has a value for each channel.
pub struct Each<'a> {
    pub a: &'a [f32],
    pub gate: Option<&'a [f32]>,
    pub b: Option<&'a [f32]>,
    pub activation: Activation,
    pub out: &'a mut [f32],
    pub stride: usize,
}

impl WithSimd for Each<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { a, gate, b, activation, out, stride } = self;
        for (first, out) in (0..).step_by(stride).zip(out.chunks_exact_mut(stride)) {
            let a = &a[first..][..stride];
            let b = b.map(|b| &b[first..][..stride]);
            for at in (0..stride).step_by(S::F32_LANES) {
                let mut value = load::<S>(a, at);
                value = gate.map_or(value, |gate| simd.mul_f32s(value, load::<S>(gate, at)));
                value = b.map_or(value, |b| simd.add_f32s(value, load::<S>(b, at)));
                store::<S>(out, at, activated(simd, activation, value));
            }
        }
        if activation == Activation::Logistic {
            logistic(out);
        }
    }
}

/// The mean of each channel of a picture, or of the sum of two.
pub struct Mean<'a> {
    pub a: &'a [f32],
    pub b: Option<&'a [f32]>,
    pub out: &'a mut [f32],
}

impl WithSimd for Mean<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let stride = self.out.len();
        let scale = simd.splat_f32s(stride as f32 / self.a.len() as f32);
        for at in (0..stride).step_by(S::F32_LANES) {
            let mut sums = [simd.splat_f32s(0.0); 4];
            for values in [Some(self.a), self.b].into_iter().flatten() {
                for (k, pixel) in values.chunks_exact(stride).enumerate() {
                    sums[k % 4] = simd.add_f32s(sums[k % 4], load::<S>(pixel, at));
                }
            }
            let sum = simd.add_f32s(simd.add_f32s(sums[0], sums[1]), simd.add_f32s(sums[2], sums[3]));
            store::<S>(self.out, at, simd.mul_f32s(sum, scale));
        }
    }
}

/// To twice the size, between the middles of pixels.
pub struct Enlarge<'a> {
    pub input: &'a [f32],
    pub size: Size,
    /// A row between two.
    pub row: &'a mut [f32],
    pub out: &'a mut [f32],
}

impl WithSimd for Enlarge<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { input, size, row, out } = self;
        let length = size.columns * size.stride;
        let beside = |at: usize, count: usize| match at.is_multiple_of(2) {
            true => (at / 2).saturating_sub(1),
            false => (at / 2 + 1).min(count - 1),
        };
        for (y, out) in out.chunks_exact_mut(2 * length).enumerate() {
            let (near, far) = (&input[y / 2 * length..][..length], &input[beside(y, size.rows) * length..][..length]);
            for ((row, near), far) in row.iter_mut().zip(near).zip(far) {
                *row = 0.75 * near + 0.25 * far;
            }
            for (x, out) in out.chunks_exact_mut(size.stride).enumerate() {
                let near = &row[x / 2 * size.stride..][..size.stride];
                let far = &row[beside(x, size.columns) * size.stride..][..size.stride];
                for ((out, near), far) in out.iter_mut().zip(near).zip(far) {
                    *out = 0.75 * near + 0.25 * far;
                }
            }
        }
    }
}
