//! Winner takes all, with the left-right consistency check: of each pixel, the disparity that costs least, if the right
//! eye agrees.

use std::ops::Range;

use super::super::fixed::{AGREE, ONE, UNKNOWN};
use super::GROUP;

/// The disparity that costs least for each pixel of a group of rows, as seen from each eye.
pub struct Eyes {
    width: usize,
    /// `[row][column]`.
    left: Vec<Winner>,
    /// `[row][column]`, mirrored: from the last column to the first, and after that the columns left of the picture.
    right: Vec<u8>,
    /// The least sums so far, laid out as `right`.
    right_sums: Vec<u8>,
}

/// A disparity, and the sums of the one below it, of itself, and of the one above; three times its own at either end.
type Winner = [u8; 4];

/// What a row of [`Eyes`] has, in some columns.
pub struct Row<'a, const N: usize> {
    left: &'a mut [Winner],
    /// From the last of the columns on.
    right: &'a mut [u8],
    right_sums: &'a mut [u8],
}

impl Eyes {
    /// Memory for rows of so many columns.
    pub fn new(width: usize, disparities: usize) -> Self {
        let right_len = GROUP * (width + disparities);
        Self { width, left: vec![[0; 4]; GROUP * width], right: vec![0; right_len], right_sums: vec![0; right_len] }
    }

    /// Begins a group of rows.
    pub fn clear(&mut self) {
        self.right_sums.fill(u8::MAX);
    }

    /// The rows, `columns` of them.
    #[inline(always)]
    pub fn rows<const N: usize>(&mut self, columns: Range<usize>) -> [Row<'_, N>; GROUP] {
        let (width, stride) = (self.width, self.width + N);
        let partners = width - columns.end..stride - columns.start;
        let mut left = self.left.chunks_exact_mut(width);
        let mut right = self.right.chunks_exact_mut(stride);
        let mut right_sums = self.right_sums.chunks_exact_mut(stride);
        std::array::from_fn(|_| Row {
            left: left.next().map_or(&mut [], |row| &mut row[columns.clone()]),
            right: right.next().map_or(&mut [], |row| &mut row[partners.clone()]),
            right_sums: right_sums.next().map_or(&mut [], |row| &mut row[partners.clone()]),
        })
    }

    /// Writes the fixed-point disparities that both eyes agree on to `out`, `[row][column]`.
    #[inline(always)]
    pub fn agreed(&self, out: &mut [u16]) {
        let (width, stride) = (self.width, self.right.len() / GROUP);
        for (row, out) in out.chunks_exact_mut(width).enumerate() {
            let (left, right) = (&self.left[row * width..][..width], &self.right[row * stride..][..stride]);
            for x in 0..width {
                out[x] = refine(left[x]);
            }
            for x in 0..width {
                let d = left[x][0];
                let apart = i32::from(right[width - 1 - x + usize::from(d)]) - i32::from(d);
                let agrees = (usize::from(d) <= x) & (apart.unsigned_abs() <= AGREE.into());
                out[x] = if agrees { out[x] } else { UNKNOWN };
            }
        }
    }
}

impl<const N: usize> Row<'_, N> {
    /// Takes the sums of pixel `x` of the columns. Pixels are taken from the left.
    #[inline(always)]
    pub fn take(&mut self, x: usize, sums: &[u8; N]) {
        let d = index_of_least(sums);
        let d = usize::from(d);
        let beside = usize::from(d > 0 && d + 1 < N);
        self.left[x] = [d as u8, sums[(d - beside) % N], sums[d % N], sums[(d + beside) % N]];
        // For each d, column x - d of the right eye, mirrored.
        let first = self.left.len() - 1 - x;
        let (right, right_sums) = (&mut self.right[first..], &mut self.right_sums[first..]);
        if let (Some(right), Some(right_sums)) = (right.first_chunk_mut(), right_sums.first_chunk_mut()) {
            keep_less::<N>(sums, right_sums, right);
        }
    }
}

/// The lowest index of the least of `cells`.
#[inline(always)]
fn index_of_least<const N: usize>(cells: &[u8; N]) -> u8 {
    let mut least = u16::MAX;
    for (d, &cell) in cells.iter().enumerate() {
        least = least.min(u16::from(cell) << 8 | d as u16);
    }
    least as u8
}

/// Where a cell is less than its sum, puts it into `sums`, and its disparity into `disparities`.
#[inline(always)]
fn keep_less<const N: usize>(cells: &[u8; N], sums: &mut [u8; N], disparities: &mut [u8; N]) {
    let mut taken = [0; N];
    for d in 0..N {
        // Bits, not a choice: that would be read from memory only where it is made.
        let less = if cells[d] < sums[d] { u8::MAX } else { 0 };
        taken[d] = (d as u8 & less) | (disparities[d] & !less);
    }
    *disparities = taken;
    for d in 0..N {
        sums[d] = sums[d].min(cells[d]);
    }
}

/// A winner to parts of a pixel, in fixed point: the minimum of a V with equally steep sides through its sum and those
/// beside it.
#[inline(always)]
fn refine([d, lower, least, upper]: Winner) -> u16 {
    let [lower, least, upper] = [lower, least, upper].map(f32::from);
    let parts = (lower - upper).abs() * f32::from(ONE / 2) / (lower.max(upper) - least).max(1.0);
    let (whole, parts) = (u16::from(d) * ONE, floor(parts));
    if lower < upper { whole - parts } else { whole + parts }
}

/// The whole number below a quotient of less than 256, whose divisor is less than 256, too. A conversion of the language
/// would be made number by number, as it treats those that fit nowhere.
#[inline(always)]
fn floor(quotient: f32) -> u16 {
    // Rounds to whole numbers when added; the last bits of the sum are the number.
    const WHOLE: f32 = 1.5 * (1 << 23) as f32;
    // No quotient is as near to the next whole number as this is to a half.
    const HALF: f32 = 0.5 - 1.0 / 512.0;
    (quotient - HALF + WHOLE).to_bits() as u16 & 0xff
}
