//! A picture in another size, row by row: bilinear where it grows; where it shrinks, by a triangle as wide as two of the
//! new pixels, so that nothing aliases.

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};

/// Fractional bits of the weights of a row's or column's taps.
const WEIGHT_BITS: u32 = 14;
/// Fractional bits of a value that is filtered down the columns but not yet along the row; fits 16 bits.
const VALUE_BITS: u32 = 8;
/// The weight of a tap that is alone.
const ONE: u16 = 1 << WEIGHT_BITS;
/// Columns that are filtered at once, and the values that a pixel of them is read as: the last is not used.
const BLOCK: usize = 128;
const VALUES: usize = 4;

/// From one size to another.
#[derive(Debug, Default)]
pub struct Scale {
    arch: Arch,
    across: Axis,
    down: Axis,
}

impl Scale {
    /// Takes other sizes (columns, rows), neither with a side of 0. Allocates only when one changes.
    pub fn adapt(&mut self, from: (usize, usize), to: (usize, usize)) {
        self.adapt_part(from, [(0.0, from.0 as f64), (0.0, from.1 as f64)], to);
    }

    /// The same for a part of the source: where it begins, and how long it is, across and down, in pixels and parts of pixels.
    /// It lies within the source. Allocates no more when another part is taken.
    pub fn adapt_part(&mut self, from: (usize, usize), [across, down]: [(f64, f64); 2], to: (usize, usize)) {
        self.across.adapt(from.0, across, to.0);
        self.down.adapt(from.1, down, to.1);
    }

    /// Writes these `columns` of the row `y` of the scaled picture to `scaled`, 3 bytes each; `from` are the pixels of
    /// the whole source, `scratch` any memory, which is grown to a row of it.
    pub fn row(&self, from: &[u8], y: usize, columns: Range<usize>, scratch: &mut Vec<u16>, scaled: &mut [u8]) {
        if columns.is_empty() {
            return;
        }
        // A pixel is read as four values.
        scratch.resize(3 * self.across.from + 1, 0);
        self.arch.dispatch(Row { scale: self, from, y, columns, row: scratch, scaled });
    }
}

/// Some columns of one row.
struct Row<'a> {
    scale: &'a Scale,
    from: &'a [u8],
    y: usize,
    columns: Range<usize>,
    row: &'a mut [u16],
    scaled: &'a mut [u8],
}

impl WithSimd for Row<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { scale: Scale { across, down, .. }, from, y, columns, row, scaled } = self;
        let stride = 3 * across.from;
        let (first, weights) = down.taps(y);
        let needed = across.needs(&columns);
        let needed = 3 * needed.start..3 * needed.end;
        filter_down(&from[stride * first + needed.start..], stride, weights, &mut row[needed]);
        across.filter(row, columns, scaled);
    }
}

/// The weighted sum of `weights.len()` rows of `stride` values each.
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
                *sum = share(upper, a) + share(lower, b);
            }
        }
        [a, b, c] => {
            let (second, third) = (&rows[stride..], &rows[2 * stride..]);
            for (((sum, &upper), &middle), &lower) in row.iter_mut().zip(rows).zip(second).zip(third) {
                *sum = share(upper, a) + share(middle, b) + share(lower, c);
            }
        }
        _ => {
            row.fill(0);
            for (values, &weight) in rows.chunks(stride).zip(weights) {
                for (sum, &value) in row.iter_mut().zip(values) {
                    *sum += share(value, weight);
                }
            }
        }
    }
}

/// A code times a weight below [`ONE`].
#[inline(always)]
fn share(code: u8, weight: u16) -> u16 {
    share_of(u16::from(code) << VALUE_BITS, upper(weight))
}

/// A value times a weight of 16 bits, cut to the value's bits: below a tenth of a code in all, for every usual size. The upper
/// half of a product of 16 bits each, which vectors have.
#[inline(always)]
fn share_of(value: u16, weight: u16) -> u16 {
    ((u32::from(value) * u32::from(weight)) >> 16) as u16
}

/// A weight of 16 bits. That of a tap that is alone is a little less than 1, which rounding makes good.
#[inline(always)]
fn upper(weight: u16) -> u16 {
    if weight == ONE { u16::MAX } else { weight << (16 - WEIGHT_BITS) }
}

/// The taps of every pixel along one axis of the scaled picture: equally many each, within the source.
#[derive(Debug, Default)]
struct Axis {
    from: usize,
    /// Where the part begins, and how long it is.
    part: (f64, f64),
    firsts: Vec<usize>,
    taps: usize,
    /// `taps` of each pixel; they sum to 1.
    weights: Vec<u16>,
    /// The same, as [`share_of`] takes them, for each of the values of a pixel: `[tap][pixel][VALUES]`.
    spread: Vec<u16>,
}

impl Axis {
    fn adapt(&mut self, from: usize, part: (f64, f64), to: usize) {
        if (self.from, self.part, self.firsts.len()) == (from, part, to) {
            return;
        }
        let (begin, length) = part;
        let ratio = length / to as f64;
        let reach = ratio.max(1.0);
        (self.from, self.part) = (from, part);
        self.taps = ((2.0 * reach).ceil() as usize).min(from);
        self.firsts.clear();
        self.weights.clear();
        for pixel in 0..to {
            let center = begin + (pixel as f64 + 0.5) * ratio - 0.5;
            let first = ((center - reach).floor() + 1.0).clamp(0.0, (from - self.taps) as f64) as usize;
            let start = self.weights.len();
            let tent = |tap: usize| (1.0 - ((first + tap) as f64 - center).abs() / reach).max(0.0);
            let sum: f64 = (0..self.taps).map(tent).sum();
            let one = f64::from(1 << WEIGHT_BITS);
            self.weights.extend((0..self.taps).map(|tap| (tent(tap) / sum * one).round() as u16));
            // What rounding left over goes where it is least: a constant picture stays as it is.
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
            self.spread.extend(weights.flat_map(|&weight| [upper(weight); VALUES]));
        }
    }

    fn taps(&self, pixel: usize) -> (usize, &[u16]) {
        (self.firsts[pixel], &self.weights[pixel * self.taps..][..self.taps])
    }

    /// The pixels of the source that these of the scaled picture are made of.
    fn needs(&self, pixels: &Range<usize>) -> Range<usize> {
        self.firsts[pixels.start]..self.firsts[pixels.end - 1] + self.taps
    }

    /// Filters some of a row of 3-channel pixels.
    #[inline(always)]
    fn filter(&self, row: &[u16], columns: Range<usize>, scaled: &mut [u8]) {
        let to = self.firsts.len();
        for (block, scaled) in scaled.as_chunks_mut::<3>().0.chunks_mut(BLOCK).enumerate() {
            let at = columns.start + block * BLOCK;
            let firsts = &self.firsts[at..at + scaled.len()];
            let mut sums = [1 << (VALUE_BITS - 1); VALUES * BLOCK];
            let mut pixels = [0; VALUES * BLOCK];
            for tap in 0..self.taps {
                // First the pixels side by side, as they lie apart; then all of them are weighed by vectors.
                for (pixel, &first) in pixels.as_chunks_mut::<VALUES>().0.iter_mut().zip(firsts) {
                    pixel.copy_from_slice(&row[3 * (first + tap)..][..VALUES]);
                }
                let weights = &self.spread[VALUES * (tap * to + at)..][..VALUES * scaled.len()];
                for ((sum, &value), &weight) in sums.iter_mut().zip(&pixels).zip(weights) {
                    *sum += share_of(value, weight);
                }
            }
            let codes = sums.map(|sum| (sum >> VALUE_BITS) as u8);
            for (scaled, code) in scaled.iter_mut().zip(codes.as_chunks::<VALUES>().0) {
                scaled.copy_from_slice(&code[..3]);
            }
        }
    }
}

/// The means of 2x2 values of two rows, rounded, into a row of half as many; an odd last column is left out.
#[inline(always)]
pub fn halve_rows(upper: &[u8], lower: &[u8], half: &mut [u8]) {
    let pairs = upper.as_chunks::<2>().0.iter().zip(lower.as_chunks::<2>().0);
    for (half, (upper, lower)) in half.iter_mut().zip(pairs) {
        let sum = upper.iter().chain(lower).map(|&value| u16::from(value)).sum::<u16>();
        *half = ((sum + 2) / 4) as u8;
    }
}
