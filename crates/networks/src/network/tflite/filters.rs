//! Convolution kernels: full, of which pointwise (1x1) ones are the simplest, and depthwise. Checked against
//! `tests/reference.rs`.

use pulp::{Simd, WithSimd};

use super::kernels::{Axis, Size, activate, as_vectors, as_vectors_mut};
use super::model::Activation;
use bokehcam::compute::simd::{fma, load};

/// Pixels per register tile, for one output block and for each of two: as many sums as 16 registers hold.
const TILE_PIXELS: usize = 12;
const TILE_PIXELS_OF_TWO: usize = TILE_PIXELS / 2;
/// Outputs of a row per tile of a depthwise filter.
const ROW_TILE: usize = 8;

/// Convolution of a row of pixels: a matrix product, register-tiled. A pixel's inputs are a run of values in each part of
/// the input: in pointwise (1x1) convolution the channels of each block, otherwise the values of each block in each line
/// under the filter, tap by tap.
pub struct Convolution<'a> {
    /// `[part][pixel, step values apart][run]`.
    pub input: &'a [f32],
    /// Values per part.
    pub part: usize,
    /// Values from pixel to pixel, and values under each.
    pub step: usize,
    pub run: usize,
    pub pixels: usize,
    /// `[output block][part][value of the run][lane]`.
    pub weights: &'a [f32],
    /// `[output channel]`.
    pub bias: &'a [f32],
    pub activation: Activation,
    /// `[block][plane]`; the first `pixels` of each plane are written.
    pub out: &'a mut [f32],
    /// Values from block to block of the output.
    pub plane: usize,
}

impl WithSimd for Convolution<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        // Runs of a known length are unrolled.
        let is_pointwise = self.run == S::F32_LANES && self.step == S::F32_LANES;
        if is_pointwise { self.compute_blocks::<S, true>(simd) } else { self.compute_blocks::<S, false>(simd) }
    }
}

impl Convolution<'_> {
    #[inline(always)]
    fn compute_blocks<S: Simd, const POINTWISE: bool>(&mut self, simd: S) {
        let blocks = self.bias.len() / S::F32_LANES;
        for block in (0..blocks / 2).map(|pair| 2 * pair) {
            self.compute_block::<S, POINTWISE, TILE_PIXELS_OF_TWO, 2>(simd, block);
        }
        if !blocks.is_multiple_of(2) {
            self.compute_block::<S, POINTWISE, TILE_PIXELS, 1>(simd, blocks - 1);
        }
    }

    #[inline(always)]
    fn compute_block<S: Simd, const POINTWISE: bool, const N: usize, const M: usize>(&mut self, simd: S, block: usize) {
        let whole = self.pixels / N * N;
        // Full tiles first, then single pixels.
        for first in (0..whole).step_by(N) {
            self.compute_tile::<S, POINTWISE, N, M>(simd, block, first);
        }
        for first in whole..self.pixels {
            self.compute_tile::<S, POINTWISE, 1, M>(simd, block, first);
        }
    }

    /// Computes `N` pixels of `M` blocks.
    #[inline(always)]
    fn compute_tile<S: Simd, const POINTWISE: bool, const N: usize, const M: usize>(
        &mut self,
        simd: S,
        block: usize,
        first: usize,
    ) {
        let (step, run) = if POINTWISE { (S::F32_LANES, S::F32_LANES) } else { (self.step, self.run) };
        let depth = self.input.len() / self.part * run;
        let weights: [&[S::f32s]; M] =
            std::array::from_fn(|m| &as_vectors::<S>(self.weights)[(block + m) * depth..][..depth]);
        let bias: [S::f32s; M] = std::array::from_fn(|m| as_vectors::<S>(self.bias)[block + m]);
        let mut sums = [bias; N];
        for (part, input) in self.input.chunks_exact(self.part).enumerate() {
            let values = &input[first * step..][..(N - 1) * step + run];
            let values: [&[f32]; N] = std::array::from_fn(|n| &values[n * step..][..run]);
            let weights = weights.map(|weights| &weights[part * run..][..run]);
            for k in 0..run {
                for (values, sums) in values.iter().zip(&mut sums) {
                    let value = simd.splat_f32s(values[k]);
                    for (sum, weights) in sums.iter_mut().zip(weights) {
                        *sum = fma(simd, value, weights[k], *sum);
                    }
                }
            }
        }
        for m in 0..M {
            let out = &mut self.out[(block + m) * self.plane + first * S::F32_LANES..][..N * S::F32_LANES];
            let out: &mut [S::f32s; N] = as_vectors_mut::<S>(out).try_into().expect("as many as are made");
            for (out, sums) in out.iter_mut().zip(&sums) {
                *out = activate(simd, self.activation, sums[m]);
            }
        }
    }
}

/// Copies the lines under the filter in one output row, for each tap and block of channels, to `lines`: with padding at
/// both ends, where `lines` must be 0.
pub fn copy_lines(input: &[f32], size: &Size, [down, across]: &[Axis; 2], row: usize, line: usize, lines: &mut [f32]) {
    let (inside, first_row) = down.taps_inside(row, size.rows);
    let row_len = size.columns * size.lanes;
    let places = (0..down.taps).flat_map(|tap| (0..size.blocks()).map(move |block| (tap, block)));
    for ((tap, block), line) in places.zip(lines.chunks_exact_mut(line)) {
        let line = &mut line[across.padding * size.lanes..][..row_len];
        if inside.contains(&tap) {
            let start = block * size.plane() + (first_row + tap - inside.start) * row_len;
            line.copy_from_slice(&input[start..][..row_len]);
        } else {
            line.fill(0.0);
        }
    }
}

/// Depthwise convolution with a stride of 1 or 2 along a row, plus a picture; `weights` are `[block][tap][lane]`.
pub struct Depthwise<'a> {
    pub input: &'a [f32],
    /// Added to the result, after the activation.
    pub b: Option<&'a [f32]>,
    pub size: Size,
    pub axes: [Axis; 2],
    pub weights: &'a [f32],
    pub bias: &'a [f32],
    pub activation: Activation,
    pub out: &'a mut [f32],
    pub result: Size,
    /// A ring buffer of as many lines as the filter has taps, with padding at both ends.
    pub lines: &'a mut [f32],
}

impl WithSimd for Depthwise<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match self.axes[1].step {
            1 => self.filter_rows::<S, 1>(simd),
            _ => self.filter_rows::<S, 2>(simd),
        }
    }
}

impl Depthwise<'_> {
    #[inline(always)]
    fn filter_rows<S: Simd, const STEP: usize>(self, simd: S) {
        let Self { input, b, size, axes: [down, across], weights, bias, activation, out, result, lines } = self;
        let line = lines.len() / down.taps;
        let (row_len, taps) = (size.columns * S::F32_LANES, across.taps * S::F32_LANES);
        lines.fill(0.0);
        let blocks = input.chunks_exact(size.plane()).zip(out.chunks_exact_mut(result.plane())).enumerate();
        for (block, (input, out)) in blocks {
            let weights = &weights[block * down.taps * taps..][..down.taps * taps];
            let bias = load::<S>(bias, block * S::F32_LANES);
            let mut rows = input.chunks_exact(row_len).enumerate();
            let b = b.map(|b| &b[block * result.plane()..][..result.plane()]);
            let out_len = result.columns * S::F32_LANES;
            for (y, out) in out.chunks_exact_mut(out_len).enumerate() {
                let b = b.map(|b| as_vectors::<S>(&b[y * out_len..][..out_len]));
                let (inside, first_row) = down.taps_inside(y, size.rows);
                let last = first_row + inside.len();
                // Read each input row into the ring buffer once, when the first output needs it.
                let next = rows.by_ref();
                while next.len() > size.rows - last {
                    let (row, values) = next.next().expect("as many as are left");
                    lines[row % down.taps * line + across.padding * S::F32_LANES..][..row_len].copy_from_slice(values);
                }
                let lines: &[f32] = lines;
                let under = (first_row..)
                    .zip(inside)
                    .map(|(row, tap)| (&lines[row % down.taps * line..][..line], &weights[tap * taps..][..taps]));
                let out = as_vectors_mut::<S>(out);
                let whole = result.columns / ROW_TILE * ROW_TILE;
                for first in (0..whole).step_by(ROW_TILE) {
                    filter_tile::<S, STEP, ROW_TILE>(simd, under.clone(), b, (bias, activation), first, out);
                }
                for first in whole..result.columns {
                    filter_tile::<S, STEP, 1>(simd, under.clone(), b, (bias, activation), first, out);
                }
            }
        }
    }
}

/// Computes `N` outputs of a row from the lines under the filter and their taps, and adds the row `b`.
#[inline(always)]
fn filter_tile<'a, S: Simd, const STEP: usize, const N: usize>(
    simd: S,
    under: impl Iterator<Item = (&'a [f32], &'a [f32])>,
    b: Option<&[S::f32s]>,
    (bias, activation): (S::f32s, Activation),
    first: usize,
    out: &mut [S::f32s],
) {
    let mut sums = [bias; N];
    for (line, weights) in under {
        let line = &as_vectors::<S>(line)[first * STEP..];
        for (tap, weight) in as_vectors::<S>(weights).iter().enumerate() {
            let pixels = &line[tap..][..(N - 1) * STEP + 1];
            for (n, sum) in sums.iter_mut().enumerate() {
                *sum = fma(simd, pixels[n * STEP], *weight, *sum);
            }
        }
    }
    let out = &mut out[first..][..N];
    for (out, sum) in out.iter_mut().zip(sums) {
        *out = activate(simd, activation, sum);
    }
    for (out, b) in out.iter_mut().zip(b.map_or(&[][..], |b| &b[first..][..N])) {
        *out = simd.add_f32s(*out, *b);
    }
}
