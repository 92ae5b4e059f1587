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
        match across.taps {
            2 => across.filter::<2>(row, columns, scaled),
            3 => across.filter::<3>(row, columns, scaled),
            4 => across.filter::<4>(row, columns, scaled),
            _ => across.filter_many(row, columns, scaled),
        }
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

/// A value times a weight below [`ONE`], cut to 8 bits of fraction: below a tenth of a code in all, for every usual size.
/// The upper half of a product of 16 bits each, which vectors have.
#[inline(always)]
fn share(value: u8, weight: u16) -> u16 {
    let (value, weight) = (u16::from(value) << VALUE_BITS, weight << (16 - WEIGHT_BITS));
    ((u32::from(value) * u32::from(weight)) >> 16) as u16
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
    }

    fn taps(&self, pixel: usize) -> (usize, &[u16]) {
        (self.firsts[pixel], &self.weights[pixel * self.taps..][..self.taps])
    }

    /// The pixels of the source that these of the scaled picture are made of.
    fn needs(&self, pixels: &Range<usize>) -> Range<usize> {
        self.firsts[pixels.start]..self.firsts[pixels.end - 1] + self.taps
    }

    /// Filters some of a row of 3-channel pixels, by `N` taps each.
    #[inline(always)]
    fn filter<const N: usize>(&self, row: &[u16], columns: Range<usize>, scaled: &mut [u8]) {
        let weights = &self.weights.as_chunks::<N>().0[columns.clone()];
        let firsts = &self.firsts[columns];
        for ((pixel, &first), weights) in scaled.as_chunks_mut::<3>().0.iter_mut().zip(firsts).zip(weights) {
            *pixel = filtered(&row[3 * first..][..3 * N + 1], weights);
        }
    }

    #[inline(always)]
    fn filter_many(&self, row: &[u16], columns: Range<usize>, scaled: &mut [u8]) {
        let weights = self.weights[columns.start * self.taps..columns.end * self.taps].chunks_exact(self.taps);
        let firsts = &self.firsts[columns];
        for ((pixel, &first), weights) in scaled.as_chunks_mut::<3>().0.iter_mut().zip(firsts).zip(weights) {
            *pixel = filtered(&row[3 * first..][..3 * self.taps + 1], weights);
        }
    }
}

/// The weighted sum of pixels. Each is read as four values; what the fourth makes is not used.
#[inline(always)]
fn filtered(pixels: &[u16], weights: &[u16]) -> [u8; 3] {
    const SHIFT: u32 = WEIGHT_BITS + VALUE_BITS;
    let mut sums = [1_u32 << (SHIFT - 1); 4];
    for (tap, &weight) in weights.iter().enumerate() {
        let values = &pixels[3 * tap..][..4];
        for (sum, &value) in sums.iter_mut().zip(values) {
            *sum += u32::from(weight) * u32::from(value);
        }
    }
    let [r, g, b, _] = sums.map(|sum| (sum >> SHIFT) as u8);
    [r, g, b]
}
