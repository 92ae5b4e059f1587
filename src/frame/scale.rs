//! A picture in another size, row by row: bilinear where it grows; where it shrinks, by a triangle as wide as two of the
//! new pixels, so that nothing aliases.

use std::ops::Range;

/// Fractional bits of the weights of a row's or column's taps.
const WEIGHT_BITS: u32 = 14;
/// Fractional bits of a value that is filtered down the columns but not yet along the row; fits 16 bits.
const VALUE_BITS: u32 = 8;

/// From one size to another.
#[derive(Debug, Default)]
pub struct Scale {
    across: Axis,
    down: Axis,
}

impl Scale {
    /// Takes other sizes (columns, rows), neither with a side of 0. Allocates only when one changes.
    pub fn adapt(&mut self, from: (usize, usize), to: (usize, usize)) {
        self.across.adapt(from.0, to.0);
        self.down.adapt(from.1, to.1);
    }

    /// Writes these `columns` of the row `y` of the scaled picture to `scaled`, 3 bytes each; `from` are the pixels of
    /// the whole source, `scratch` any memory, which is grown to a row of it.
    pub fn row(&self, from: &[u8], y: usize, columns: Range<usize>, scratch: &mut Vec<u16>, scaled: &mut [u8]) {
        if columns.is_empty() {
            return;
        }
        let stride = 3 * self.across.from;
        scratch.resize(stride, 0);
        let (first, weights) = self.down.taps(y);
        let needed = self.across.needs(&columns);
        let needed = 3 * needed.start..3 * needed.end;
        filter_down(&from[stride * first + needed.start..], stride, weights, &mut scratch[needed]);
        self.across.filter(scratch, columns, scaled);
    }
}

/// The weighted sum of `weights.len()` rows of `stride` values each.
fn filter_down(rows: &[u8], stride: usize, weights: &[u16], row: &mut [u16]) {
    const SHIFT: u32 = WEIGHT_BITS - VALUE_BITS;
    match *weights {
        [weight] if weight == 1 << WEIGHT_BITS => {
            for (sum, &value) in row.iter_mut().zip(rows) {
                *sum = u16::from(value) << VALUE_BITS;
            }
        }
        [a, b] => {
            let (a, b) = (u32::from(a), u32::from(b));
            for ((sum, &upper), &lower) in row.iter_mut().zip(rows).zip(&rows[stride..]) {
                *sum = ((a * u32::from(upper) + b * u32::from(lower)) >> SHIFT) as u16;
            }
        }
        _ => {
            row.fill(0);
            for (values, &weight) in rows.chunks(stride).zip(weights) {
                for (sum, &value) in row.iter_mut().zip(values) {
                    // Each term cut to 8 bits of fraction: below a tenth of a code in all, for every usual size.
                    *sum += ((u32::from(weight) * u32::from(value)) >> SHIFT) as u16;
                }
            }
        }
    }
}

/// The taps of every pixel along one axis of the scaled picture: equally many each, within the source.
#[derive(Debug, Default)]
struct Axis {
    from: usize,
    firsts: Vec<usize>,
    taps: usize,
    /// `taps` of each pixel; they sum to 1.
    weights: Vec<u16>,
}

impl Axis {
    fn adapt(&mut self, from: usize, to: usize) {
        if (self.from, self.firsts.len()) == (from, to) {
            return;
        }
        let ratio = from as f64 / to as f64;
        let reach = ratio.max(1.0);
        self.from = from;
        self.taps = ((2.0 * reach).ceil() as usize).min(from);
        self.firsts.clear();
        self.weights.clear();
        for pixel in 0..to {
            let center = (pixel as f64 + 0.5) * ratio - 0.5;
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

    /// Filters some of a row of 3-channel pixels.
    fn filter(&self, row: &[u16], columns: Range<usize>, scaled: &mut [u8]) {
        const SHIFT: u32 = WEIGHT_BITS + VALUE_BITS;
        let pixels = row.as_chunks::<3>().0;
        let weights = self.weights[columns.start * self.taps..columns.end * self.taps].chunks_exact(self.taps);
        let firsts = &self.firsts[columns];
        for ((pixel, &first), weights) in scaled.as_chunks_mut::<3>().0.iter_mut().zip(firsts).zip(weights) {
            let mut sums = [1_u32 << (SHIFT - 1); 3];
            for (values, &weight) in pixels[first..].iter().zip(weights) {
                for channel in 0..3 {
                    sums[channel] += u32::from(weight) * u32::from(values[channel]);
                }
            }
            for channel in 0..3 {
                pixel[channel] = (sums[channel] >> SHIFT) as u8;
            }
        }
    }
}
