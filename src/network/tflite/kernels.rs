//! The operators, on pictures in blocks of channels: as many as a vector has, side by side, for one pixel after the other.
//! A step along a row is then a step of one vector, whatever the network's channels (nChw8c of oneDNN).

use pulp::{Simd, WithSimd};

use super::model::{Activation, Steps};
use crate::compute::simd::{fma, load};

/// Pixels of which sums are made at once for one block, and for each of two: what 16 registers hold.
const AT_ONCE: usize = 12;
const AT_ONCE_OF_TWO: usize = AT_ONCE / 2;
/// Results of a row that a filter makes at once.
const ALONG: usize = 8;

/// A picture's size, and how it is in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    pub rows: usize,
    pub columns: usize,
    pub channels: usize,
    /// Channels of a block; those of the last one that are too many are never looked at, or meet weights of 0.
    pub lanes: usize,
}

impl Size {
    pub fn blocks(&self) -> usize {
        self.channels.div_ceil(self.lanes)
    }

    pub fn pixels(&self) -> usize {
        self.rows * self.columns
    }

    /// Values in memory.
    pub fn len(&self) -> usize {
        self.blocks() * self.plane()
    }

    /// Values of a block.
    pub fn plane(&self) -> usize {
        self.pixels() * self.lanes
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
    fn new(taps: usize, step: usize, beyond: bool, pixels: usize) -> Option<(Self, usize)> {
        let count = if beyond { pixels.div_ceil(step) } else { pixels.checked_sub(taps)? / step + 1 };
        let outside = (count.checked_sub(1)? * step + taps).saturating_sub(pixels);
        Some((Self { taps, step, before: if beyond { outside / 2 } else { 0 } }, count))
    }

    /// The taps of a result that lie in the picture, and the pixel under the first of them.
    fn inside(&self, at: usize, pixels: usize) -> (std::ops::Range<usize>, usize) {
        let first = at * self.step;
        let from = self.before.saturating_sub(first);
        let to = (pixels + self.before).saturating_sub(first).min(self.taps);
        (from..to.max(from), (first + from).saturating_sub(self.before))
    }

    /// Pixels of a line with all that lies beyond its ends, for so many results of it.
    pub fn line(&self, pixels: usize, results: usize) -> usize {
        (self.before + pixels).max((results - 1) * self.step + self.taps)
    }
}

/// The axes of a filter over a picture, and the rows and columns of what it makes.
pub fn axes(size: &Size, [down, across]: [usize; 2], steps: &Steps) -> Option<([Axis; 2], [usize; 2])> {
    let (down, rows) = Axis::new(down, steps.down, steps.beyond, size.rows)?;
    let (across, columns) = Axis::new(across, steps.across, steps.beyond, size.columns)?;
    Some(([down, across], [rows, columns]))
}

/// Values as vectors: all of them, as every picture has whole ones.
#[inline(always)]
fn vectors<S: Simd>(values: &[f32]) -> &[S::f32s] {
    S::as_simd_f32s(values).0
}

#[inline(always)]
fn vectors_mut<S: Simd>(values: &mut [f32]) -> &mut [S::f32s] {
    S::as_mut_simd_f32s(values).0
}

#[inline(always)]
fn activated<S: Simd>(simd: S, activation: Activation, sum: S::f32s) -> S::f32s {
    let zero = simd.splat_f32s(0.0);
    match activation {
        // Few are logistic but those of the mask: a pass of its own does them.
        Activation::None | Activation::Logistic => sum,
        Activation::Relu => simd.max_f32s(sum, zero),
        Activation::HardSwish => {
            let gate = simd.add_f32s(sum, simd.splat_f32s(3.0));
            let gate = simd.min_f32s(simd.max_f32s(gate, zero), simd.splat_f32s(6.0));
            simd.mul_f32s(simd.mul_f32s(sum, gate), simd.splat_f32s(1.0 / 6.0))
        }
    }
}

/// 1 / (1 + exp(-x)) of each value.
pub struct Logistic<'a> {
    pub values: &'a mut [f32],
}

impl WithSimd for Logistic<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for value in self.values {
            *value = 1.0 / (1.0 + exp(-*value));
        }
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

/// Sums over the channels of each pixel.
pub struct Pointwise<'a> {
    /// `[block][pixel][lane]`.
    pub input: &'a [f32],
    pub pixels: usize,
    /// `[block of the result][channel][lane]`.
    pub weights: &'a [f32],
    /// `[channel of the result]`.
    pub bias: &'a [f32],
    pub activation: Activation,
    /// `[block][plane]`, of which the first pixels are made.
    pub out: &'a mut [f32],
    /// Values from block to block of the result.
    pub plane: usize,
}

impl WithSimd for Pointwise<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let blocks = self.bias.len() / S::F32_LANES;
        for block in (0..blocks / 2).map(|pair| 2 * pair) {
            self.all::<S, AT_ONCE_OF_TWO, 2>(simd, block);
        }
        if !blocks.is_multiple_of(2) {
            self.all::<S, AT_ONCE, 1>(simd, blocks - 1);
        }
    }
}

impl Pointwise<'_> {
    #[inline(always)]
    fn all<S: Simd, const N: usize, const M: usize>(&mut self, simd: S, block: usize) {
        let whole = self.pixels / N * N;
        for first in (0..whole).step_by(N) {
            self.sums::<S, N, M>(simd, block, first);
        }
        for first in whole..self.pixels {
            self.sums::<S, 1, M>(simd, block, first);
        }
    }

    /// `N` pixels of `M` blocks.
    #[inline(always)]
    fn sums<S: Simd, const N: usize, const M: usize>(&mut self, simd: S, block: usize, first: usize) {
        let (plane, depth) = (self.pixels * S::F32_LANES, self.input.len() / self.pixels);
        let weights: [&[S::f32s]; M] =
            std::array::from_fn(|m| &vectors::<S>(self.weights)[(block + m) * depth..][..depth]);
        let bias: [S::f32s; M] = std::array::from_fn(|m| vectors::<S>(self.bias)[block + m]);
        let mut sums = [bias; N];
        for (part, input) in self.input.chunks_exact(plane).enumerate() {
            let pixels = &input[first * S::F32_LANES..][..N * S::F32_LANES];
            let weights = weights.map(|weights| &weights[part * S::F32_LANES..][..S::F32_LANES]);
            for lane in 0..S::F32_LANES {
                for (n, sums) in sums.iter_mut().enumerate() {
                    let value = simd.splat_f32s(pixels[n * S::F32_LANES + lane]);
                    for (sum, weights) in sums.iter_mut().zip(weights) {
                        *sum = fma(simd, value, weights[lane], *sum);
                    }
                }
            }
        }
        for m in 0..M {
            let out = &mut self.out[(block + m) * self.plane + first * S::F32_LANES..][..N * S::F32_LANES];
            let out = vectors_mut::<S>(out);
            for n in 0..N {
                out[n] = activated(simd, self.activation, sums[n][m]);
            }
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

/// What lies under the filter of each result of a row, as channels of a picture of one row: the filter then is one over channels.
/// `out` has zeros where nothing is ever written.
pub fn under_filter(input: &[f32], size: &Size, [down, across]: &[Axis; 2], row: usize, made: &Size, out: &mut [f32]) {
    let (rows, first_row) = down.inside(row, size.rows);
    let taps = (0..down.taps).flat_map(|tap| (0..across.taps).map(move |column| (tap, column)));
    for (place, (tap, column)) in taps.enumerate() {
        // The results that have this tap in the picture.
        let from = across.before.saturating_sub(column).div_ceil(across.step);
        let to = (size.columns + across.before).saturating_sub(column).div_ceil(across.step).min(made.columns);
        for channel in 0..size.channels {
            let (depth, lane) = (place * size.channels + channel, channel % size.lanes);
            let block = &mut out[depth / made.lanes * made.plane()..][..made.plane()];
            let pixels = block.chunks_exact_mut(made.lanes).take(to).skip(from).map(|out| &mut out[depth % made.lanes]);
            if !rows.contains(&tap) {
                pixels.for_each(|out| *out = 0.0);
            } else if from < to {
                let line =
                    channel / size.lanes * size.plane() + (first_row + tap - rows.start) * size.columns * size.lanes;
                let line = &input[line..][..size.columns * size.lanes];
                let line = &line[(from * across.step + column - across.before) * size.lanes..];
                pixels.zip(line.chunks(across.step * size.lanes)).for_each(|(out, input)| *out = input[lane]);
            }
        }
    }
}

/// A filter for each channel, at steps of 1 or 2 along a row: `weights` are `[block][tap][lane]`.
pub struct Depthwise<'a> {
    pub input: &'a [f32],
    pub size: Size,
    pub axes: [Axis; 2],
    pub weights: &'a [f32],
    pub bias: &'a [f32],
    pub activation: Activation,
    pub out: &'a mut [f32],
    pub result: Size,
    /// As many lines as the filter has, with what lies beyond their ends.
    pub lines: &'a mut [f32],
}

impl WithSimd for Depthwise<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match self.axes[1].step {
            1 => self.along::<S, 1>(simd),
            _ => self.along::<S, 2>(simd),
        }
    }
}

impl Depthwise<'_> {
    #[inline(always)]
    fn along<S: Simd, const STEP: usize>(self, simd: S) {
        let Self { input, size, axes: [down, across], weights, bias, activation, out, result, lines } = self;
        let line = lines.len() / down.taps;
        let (row_len, taps) = (size.columns * S::F32_LANES, across.taps * S::F32_LANES);
        lines.fill(0.0);
        let blocks = input.chunks_exact(size.plane()).zip(out.chunks_exact_mut(result.plane())).enumerate();
        for (block, (input, out)) in blocks {
            let weights = &weights[block * down.taps * taps..][..down.taps * taps];
            let bias = load::<S>(bias, block * S::F32_LANES);
            let mut rows = input.chunks_exact(row_len).enumerate();
            for (y, out) in out.chunks_exact_mut(result.columns * S::F32_LANES).enumerate() {
                let (inside, first_row) = down.inside(y, size.rows);
                let last = first_row + inside.len();
                let next = rows.by_ref();
                while next.len() > size.rows - last {
                    let (row, values) = next.next().expect("as many as are left");
                    lines[row % down.taps * line + across.before * S::F32_LANES..][..row_len].copy_from_slice(values);
                }
                let lines: &[f32] = lines;
                let under = (first_row..)
                    .zip(inside)
                    .map(|(row, tap)| (&lines[row % down.taps * line..][..line], &weights[tap * taps..][..taps]));
                let out = vectors_mut::<S>(out);
                let whole = result.columns / ALONG * ALONG;
                for first in (0..whole).step_by(ALONG) {
                    filtered::<S, STEP, ALONG>(simd, under.clone(), bias, activation, first, out);
                }
                for first in whole..result.columns {
                    filtered::<S, STEP, 1>(simd, under.clone(), bias, activation, first, out);
                }
            }
        }
    }
}

/// `N` results of a row, of lines and the taps on them.
#[inline(always)]
fn filtered<'a, S: Simd, const STEP: usize, const N: usize>(
    simd: S,
    under: impl Iterator<Item = (&'a [f32], &'a [f32])>,
    bias: S::f32s,
    activation: Activation,
    first: usize,
    out: &mut [S::f32s],
) {
    let mut sums = [bias; N];
    for (line, weights) in under {
        let line = &vectors::<S>(line)[first * STEP..];
        for (tap, weight) in vectors::<S>(weights).iter().enumerate() {
            let pixels = &line[tap..][..(N - 1) * STEP + 1];
            for (n, sum) in sums.iter_mut().enumerate() {
                *sum = fma(simd, pixels[n * STEP], *weight, *sum);
            }
        }
    }
    for (out, sum) in out[first..][..N].iter_mut().zip(sums) {
        *out = activated(simd, activation, sum);
    }
}

/// What is done to each value by itself, or to two of the same place; `gate` has a value for each channel.
pub struct Each<'a> {
    pub a: &'a [f32],
    pub gate: Option<&'a [f32]>,
    pub b: Option<&'a [f32]>,
    pub activation: Activation,
    pub out: &'a mut [f32],
    /// Values of a block.
    pub plane: usize,
}

impl WithSimd for Each<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { a, gate, b, activation, out, plane } = self;
        let one = simd.splat_f32s(1.0);
        for (block, out) in out.chunks_exact_mut(plane).enumerate() {
            let a = vectors::<S>(&a[block * plane..][..plane]);
            let gate = gate.map_or(one, |gate| load::<S>(gate, block * S::F32_LANES));
            let out = vectors_mut::<S>(out).iter_mut().zip(a);
            match b {
                Some(b) => out.zip(vectors::<S>(&b[block * plane..][..plane])).for_each(|((out, a), b)| {
                    *out = activated(simd, activation, fma(simd, *a, gate, *b));
                }),
                None => out.for_each(|(out, a)| *out = activated(simd, activation, simd.mul_f32s(*a, gate))),
            }
        }
    }
}

/// The mean of each channel of a picture, or of the sum of two.
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
        for (block, out) in vectors_mut::<S>(self.out).iter_mut().enumerate() {
            let mut sums = [simd.splat_f32s(0.0); 4];
            for values in [Some(self.a), self.b].into_iter().flatten() {
                for (k, pixel) in vectors::<S>(&values[block * self.plane..][..self.plane]).iter().enumerate() {
                    sums[k % 4] = simd.add_f32s(sums[k % 4], *pixel);
                }
            }
            let sum = simd.add_f32s(simd.add_f32s(sums[0], sums[1]), simd.add_f32s(sums[2], sums[3]));
            *out = simd.mul_f32s(sum, scale);
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
                let line = |y: usize| vectors::<S>(&input[y * length..][..length]);
                let row = vectors_mut::<S>(row);
                for ((row, near), far) in row.iter_mut().zip(line(y / 2)).zip(line(beside(y, size.rows))) {
                    *row = between(*near, *far);
                }
                for (x, out) in vectors_mut::<S>(out).iter_mut().enumerate() {
                    *out = between(row[x / 2], row[beside(x, size.columns)]);
                }
            }
        }
    }
}
