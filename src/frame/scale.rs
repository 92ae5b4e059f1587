//! Scales a picture row by row: bilinear when enlarging; when shrinking, with a triangle filter twice as wide as a new
//! pixel, which avoids aliasing.

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};

/// Fractional bits of the tap weights.
const WEIGHT_BITS: u32 = 14;
/// Fractional bits of a value between the vertical and the horizontal filter; fits 16 bits.
const VALUE_BITS: u32 = 8;
/// Weight of a single tap.
const ONE: u16 = 1 << WEIGHT_BITS;
/// Columns that are filtered at once, and the values that are read per pixel, of which the last is unused.
const BLOCK: usize = 128;
const VALUES: usize = 4;

/// Scaler from one size to another.
#[derive(Debug, Default)]
pub struct RowScaler {
    arch: Arch,
    across: Axis,
    down: Axis,
}

impl RowScaler {
    /// Sets the sizes (columns, rows), all sides above 0. Allocates only when a size changes.
    pub fn set_sizes(&mut self, from: (usize, usize), to: (usize, usize)) {
        self.set_crop(from, [(0.0, from.0 as f64), (0.0, from.1 as f64)], to);
    }

    /// Sets the sizes for a part of the source, given by start and length across and down, in fractional pixels. The
    /// part is inside the source. Changing only the part does not allocate.
    pub fn set_crop(&mut self, from: (usize, usize), [across, down]: [(f64, f64); 2], to: (usize, usize)) {
        self.across.adapt(from.0, across, to.0);
        self.down.adapt(from.1, down, to.1);
    }

    /// Writes these `columns` of row `y` of the scaled picture to `scaled`, 3 bytes each. `from` is the whole source;
    /// `scratch` grows to one row of it.
    pub fn scale_row(&self, from: &[u8], y: usize, columns: Range<usize>, scratch: &mut Vec<u16>, scaled: &mut [u8]) {
        if columns.is_empty() {
            return;
        }
        // Four values are read per pixel.
        scratch.resize(3 * self.across.from + 1, 0);
        self.arch.dispatch(ScaleRow { scale: self, from, y, columns, row: scratch, scaled });
    }
}

/// Some columns of one row.
struct ScaleRow<'a> {
    scale: &'a RowScaler,
    from: &'a [u8],
    y: usize,
    columns: Range<usize>,
    row: &'a mut [u16],
    scaled: &'a mut [u8],
}

impl WithSimd for ScaleRow<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { scale: RowScaler { across, down, .. }, from, y, columns, row, scaled } = self;
        let stride = 3 * across.from;
        let (first, weights) = down.taps(y);
        let needed = across.source_range(&columns);
        let needed = 3 * needed.start..3 * needed.end;
        filter_down(&from[stride * first + needed.start..], stride, weights, &mut row[needed]);
        across.filter_columns(row, columns, scaled);
    }
}

/// Computes the weighted sum of `weights.len()` rows of `stride` values each.
#[inline(always)]
fn filter_down(rows: &[u8], stride: usize, weights: &[u16], row: &mut [u16]) {
    if let Some(alone) = weights.iter().position(|&weight| weight == ONE) {
        for (sum, &value) in row.iter_mut().zip(&rows[alone * stride..]) {
            *sum = u16::from(value) << VALUE_BITS;
        }
        return;
    }
    match *weights {
        [a, b] => {
            for ((sum, &upper), &lower) in row.iter_mut().zip(rows).zip(&rows[stride..]) {
                *sum = apply_weight(upper, a) + apply_weight(lower, b);
            }
        }
        [a, b, c] => {
            let (second, third) = (&rows[stride..], &rows[2 * stride..]);
            for (((sum, &upper), &middle), &lower) in row.iter_mut().zip(rows).zip(second).zip(third) {
                *sum = apply_weight(upper, a) + apply_weight(middle, b) + apply_weight(lower, c);
            }
        }
        _ => {
            row.fill(0);
            for (values, &weight) in rows.chunks(stride).zip(weights) {
                for (sum, &value) in row.iter_mut().zip(values) {
                    *sum += apply_weight(value, weight);
                }
            }
        }
    }
}

/// Multiplies a code by a weight below [`ONE`].
#[inline(always)]
fn apply_weight(code: u8, weight: u16) -> u16 {
    multiply_high(u16::from(code) << VALUE_BITS, to_u16_weight(weight))
}

/// Multiplies a value by a 16-bit weight, truncated: the total error is below a tenth of a code for all usual sizes.
/// The high half of a 16-bit product is a vector instruction.
#[inline(always)]
fn multiply_high(value: u16, weight: u16) -> u16 {
    ((u32::from(value) * u32::from(weight)) >> 16) as u16
}

/// Converts a weight to 16 bits. The weight of a single tap is slightly below 1, which rounding corrects.
#[inline(always)]
fn to_u16_weight(weight: u16) -> u16 {
    if weight == ONE { u16::MAX } else { weight << (16 - WEIGHT_BITS) }
}

/// Taps of every pixel along one axis of the scaled picture: the same number each, inside the source.
#[derive(Debug, Default)]
struct Axis {
    from: usize,
    /// Start and length of the part of the source.
    part: (f64, f64),
    firsts: Vec<usize>,
    taps: usize,
    /// `taps` weights per pixel, with sum 1.
    weights: Vec<u16>,
    /// Same weights in the format of [`multiply_high`], repeated for each of the values of a pixel:
    /// `[tap][pixel][VALUES]`.
    spread: Vec<u16>,
}

impl Axis {
    /// Computes the tent filter that scales `part` of `from` pixels to `to` pixels, unless it is there already.
    fn adapt(&mut self, from: usize, part: (f64, f64), to: usize) {
        if (self.from, self.part, self.firsts.len()) == (from, part, to) {
            return;
        }
        let (begin, length) = part;
        let ratio = length / to as f64;
        let radius = ratio.max(1.0);
        (self.from, self.part) = (from, part);
        self.taps = ((2.0 * radius).ceil() as usize).min(from);
        self.firsts.clear();
        self.weights.clear();
        for pixel in 0..to {
            let center = begin + (pixel as f64 + 0.5) * ratio - 0.5;
            let first = ((center - radius).floor() + 1.0).clamp(0.0, (from - self.taps) as f64) as usize;
            let start = self.weights.len();
            let tent = |tap: usize| (1.0 - ((first + tap) as f64 - center).abs() / radius).max(0.0);
            let sum: f64 = (0..self.taps).map(tent).sum();
            let one = f64::from(1 << WEIGHT_BITS);
            self.weights.extend((0..self.taps).map(|tap| (tent(tap) / sum * one).round() as u16));
            // The rounding error is added to the largest weight, where it matters least: a constant picture stays
            // constant.
            let weights = &mut self.weights[start..];
            let left_over = (1 << WEIGHT_BITS) - weights.iter().map(|&weight| i32::from(weight)).sum::<i32>();
            if let Some(largest) = weights.iter_mut().max() {
                *largest = (i32::from(*largest) + left_over) as u16;
            }
            self.firsts.push(first);
        }
        self.spread.clear();
        for tap in 0..self.taps {
            let weights = self.weights.iter().skip(tap).step_by(self.taps);
            self.spread.extend(weights.flat_map(|&weight| [to_u16_weight(weight); VALUES]));
        }
    }

    fn taps(&self, pixel: usize) -> (usize, &[u16]) {
        (self.firsts[pixel], &self.weights[pixel * self.taps..][..self.taps])
    }

    /// Returns the source pixels that these scaled pixels depend on.
    fn source_range(&self, pixels: &Range<usize>) -> Range<usize> {
        self.firsts[pixels.start]..self.firsts[pixels.end - 1] + self.taps
    }

    /// Filters part of a row of 3-channel pixels.
    #[inline(always)]
    fn filter_columns(&self, row: &[u16], columns: Range<usize>, scaled: &mut [u8]) {
        let to = self.firsts.len();
        for (block, scaled) in scaled.as_chunks_mut::<3>().0.chunks_mut(BLOCK).enumerate() {
            let at = columns.start + block * BLOCK;
            let firsts = &self.firsts[at..at + scaled.len()];
            let mut sums = [1 << (VALUE_BITS - 1); VALUES * BLOCK];
            let mut pixels = [0; VALUES * BLOCK];
            for tap in 0..self.taps {
                // Gathers the scattered pixels first; then vectors weight all of them.
                for (pixel, &first) in pixels.as_chunks_mut::<VALUES>().0.iter_mut().zip(firsts) {
                    pixel.copy_from_slice(&row[3 * (first + tap)..][..VALUES]);
                }
                let weights = &self.spread[VALUES * (tap * to + at)..][..VALUES * scaled.len()];
                for ((sum, &value), &weight) in sums.iter_mut().zip(&pixels).zip(weights) {
                    *sum += multiply_high(value, weight);
                }
            }
            let codes = sums.map(|sum| (sum >> VALUE_BITS) as u8);
            for (scaled, code) in scaled.iter_mut().zip(codes.as_chunks::<VALUES>().0) {
                scaled.copy_from_slice(&code[..3]);
            }
        }
    }
}

/// Writes the rounded means of 2x2 values of two rows to a row of half the length; drops an odd last column.
#[inline(always)]
pub fn halve_rows(upper: &[u8], lower: &[u8], half: &mut [u8]) {
    let pairs = upper.as_chunks::<2>().0.iter().zip(lower.as_chunks::<2>().0);
    for (half, (upper, lower)) in half.iter_mut().zip(pairs) {
        let sum = upper.iter().chain(lower).map(|&value| u16::from(value)).sum::<u16>();
        *half = ((sum + 2) / 4) as u8;
    }
}
