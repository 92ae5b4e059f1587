//! Convolution kernels: pointwise (1x1), im2col for larger filters, and depthwise. Checked against
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

/// Pointwise (1x1) convolution: a matrix product over channels, register-tiled.
pub struct Pointwise<'a> {
    /// `[block][pixel][lane]`.
    pub input: &'a [f32],
    pub pixels: usize,
    /// `[output block][channel][lane]`.
    pub weights: &'a [f32],
    /// `[output channel]`.
    pub bias: &'a [f32],
    pub activation: Activation,
    /// `[block][plane]`; the first `pixels` of each plane are written.
    pub out: &'a mut [f32],
    /// Values from block to block of the output.
    pub plane: usize,
}

impl WithSimd for Pointwise<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let blocks = self.bias.len() / S::F32_LANES;
        for block in (0..blocks / 2).map(|pair| 2 * pair) {
            self.compute_block::<S, TILE_PIXELS_OF_TWO, 2>(simd, block);
        }
        if !blocks.is_multiple_of(2) {
            self.compute_block::<S, TILE_PIXELS, 1>(simd, blocks - 1);
        }
    }
}

impl Pointwise<'_> {
    #[inline(always)]
    fn compute_block<S: Simd, const N: usize, const M: usize>(&mut self, simd: S, block: usize) {
        let whole = self.pixels / N * N;
        // Full tiles first, then single pixels.
        for first in (0..whole).step_by(N) {
            self.compute_tile::<S, N, M>(simd, block, first);
        }
        for first in whole..self.pixels {
            self.compute_tile::<S, 1, M>(simd, block, first);
        }
    }

    /// Computes `N` pixels of `M` blocks.
    #[inline(always)]
    fn compute_tile<S: Simd, const N: usize, const M: usize>(&mut self, simd: S, block: usize, first: usize) {
        let (plane, depth) = (self.pixels * S::F32_LANES, self.input.len() / self.pixels);
        let weights: [&[S::f32s]; M] =
            std::array::from_fn(|m| &as_vectors::<S>(self.weights)[(block + m) * depth..][..depth]);
        let bias: [S::f32s; M] = std::array::from_fn(|m| as_vectors::<S>(self.bias)[block + m]);
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
            let out: &mut [S::f32s; N] = as_vectors_mut::<S>(out).try_into().expect("as many as are made");
            for (out, sums) in out.iter_mut().zip(&sums) {
                *out = activate(simd, self.activation, sums[m]);
            }
        }
    }
}

/// Unfolds the inputs of one output row (im2col): every tap becomes a channel, so that the filter is a pointwise
/// convolution. Values of `out` that are never written must be 0 (padding of channels), and so must those of `line`,
/// a row with padding at both ends ([`Axis::padded_len`]).
pub fn im2col_row(
    input: &[f32],
    size: &Size,
    [down, across]: &[Axis; 2],
    row: usize,
    made: &Size,
    line: &mut [f32],
    out: &mut [f32],
) {
    let (rows, first_row) = down.taps_inside(row, size.rows);
    let row_len = size.columns * size.lanes;
    for (tap, block) in (0..down.taps).flat_map(|tap| (0..size.blocks()).map(move |block| (tap, block))) {
        let inside = &mut line[across.padding * size.lanes..][..row_len];
        if rows.contains(&tap) {
            let start = block * size.plane() + (first_row + tap - rows.start) * row_len;
            inside.copy_from_slice(&input[start..][..row_len]);
        } else {
            inside.fill(0.0);
        }
        let channels = size.lanes.min(size.channels - block * size.lanes);
        // In a single block without unused channels, all values under a row of the filter are adjacent.
        let (runs, run) = match size.lanes == size.channels {
            true => (1, across.taps * channels),
            false => (across.taps, channels),
        };
        for column in 0..runs {
            let (mut depth, mut from) = ((tap * across.taps + column) * size.channels + block * size.lanes, 0);
            while from < run {
                let lane = depth % made.lanes;
                let count = (made.lanes - lane).min(run - from);
                let pixels = out[depth / made.lanes * made.plane()..][..made.plane()].chunks_exact_mut(made.lanes);
                let places = (column * size.lanes + from..).step_by(across.step * size.lanes);
                for (pixel, place) in pixels.zip(places) {
                    let values = pixel[lane..][..count].iter_mut().zip(&line[place..][..count]);
                    values.for_each(|(out, value)| *out = *value);
                }
                (depth, from) = (depth + count, from + count);
            }
        }
    }
}

/// Depthwise convolution with a stride of 1 or 2 along a row; `weights` are `[block][tap][lane]`.
pub struct Depthwise<'a> {
    pub input: &'a [f32],
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
                    filter_tile::<S, STEP, ROW_TILE>(simd, under.clone(), bias, activation, first, out);
                }
                for first in whole..result.columns {
                    filter_tile::<S, STEP, 1>(simd, under.clone(), bias, activation, first, out);
                }
            }
        }
    }
}

/// Computes `N` outputs of a row from the lines under the filter and their taps.
#[inline(always)]
fn filter_tile<'a, S: Simd, const STEP: usize, const N: usize>(
    simd: S,
    under: impl Iterator<Item = (&'a [f32], &'a [f32])>,
    bias: S::f32s,
    activation: Activation,
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
    for (out, sum) in out[first..][..N].iter_mut().zip(sums) {
        *out = activate(simd, activation, sum);
    }
}
