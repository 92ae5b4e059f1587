//! Winner takes all with the left-right consistency check: for each left pixel, the disparity with the least sum,
//! unless the winner of its right partner differs by more than [`MAX_LR_DIFFERENCE`].
//!
//! twin: shaders/stereo/winners.wgsl

use std::ops::Range;

use super::super::fixed::{MAX_LR_DIFFERENCE, ONE, UNKNOWN};
use super::GROUP;

/// The winners of a group of rows, for left and for right pixels.
pub struct Winners {
    width: usize,
    /// `[row][column]`.
    left: Vec<Winner>,
    /// `[row][column]`, mirrored: from the last column to the first, and then the columns left of the picture.
    right: Vec<u8>,
    /// The least sums so far, laid out like `right`.
    right_sums: Vec<u8>,
}

/// A disparity, and the sums of the one below it, of itself, and of the one above; three times its own at either end.
type Winner = [u8; 4];

/// Winners of a row in a range of columns.
pub struct WinnerRow<'a, const N: usize> {
    left: &'a mut [Winner],
    /// Mirrored: from the last of the columns on.
    right: &'a mut [u8],
    right_sums: &'a mut [u8],
}

impl Winners {
    /// Allocates for rows of `width` columns.
    pub fn new(width: usize, disparities: usize) -> Self {
        let right_len = GROUP * (width + disparities);
        Self { width, left: vec![[0; 4]; GROUP * width], right: vec![0; right_len], right_sums: vec![0; right_len] }
    }

    /// Resets the winners for a new group of rows.
    pub fn clear(&mut self) {
        self.right_sums.fill(u8::MAX);
    }

    /// Returns the rows of the group, limited to `columns`.
    #[inline(always)]
    pub fn rows_mut<const N: usize>(&mut self, columns: Range<usize>) -> [WinnerRow<'_, N>; GROUP] {
        let (width, stride) = (self.width, self.width + N);
        let partners = width - columns.end..stride - columns.start;
        let mut left = self.left.chunks_exact_mut(width);
        let mut right = self.right.chunks_exact_mut(stride);
        let mut right_sums = self.right_sums.chunks_exact_mut(stride);
        std::array::from_fn(|_| WinnerRow {
            left: left.next().map_or(&mut [], |row| &mut row[columns.clone()]),
            right: right.next().map_or(&mut [], |row| &mut row[partners.clone()]),
            right_sums: right_sums.next().map_or(&mut [], |row| &mut row[partners.clone()]),
        })
    }

    /// Writes the fixed-point disparities that pass the left-right consistency check to `out`, `[row][column]`, or
    /// unknown.
    #[inline(always)]
    pub fn write_consistent(&self, out: &mut [u16]) {
        let (width, stride) = (self.width, self.right.len() / GROUP);
        for (row, out) in out.chunks_exact_mut(width).enumerate() {
            let (left, right) = (&self.left[row * width..][..width], &self.right[row * stride..][..stride]);
            for x in 0..width {
                out[x] = subpixel_disparity(left[x]);
            }
            for x in 0..width {
                let d = left[x][0];
                let apart = i32::from(right[width - 1 - x + usize::from(d)]) - i32::from(d);
                let agrees = (usize::from(d) <= x) & (apart.unsigned_abs() <= MAX_LR_DIFFERENCE.into());
                out[x] = if agrees { out[x] } else { UNKNOWN };
            }
        }
    }
}

impl<const N: usize> WinnerRow<'_, N> {
    /// Updates the winners with the sums of pixel `x` of the columns. Pixels must come from left to right.
    #[inline(always)]
    pub fn update(&mut self, x: usize, sums: &[u8; N]) {
        let d = argmin(sums);
        let d = usize::from(d);
        let beside = usize::from(d > 0 && d + 1 < N);
        self.left[x] = [d as u8, sums[(d - beside) % N], sums[d % N], sums[(d + beside) % N]];
        // For each d, column x - d of the right picture, mirrored.
        let first = self.left.len() - 1 - x;
        let (right, right_sums) = (&mut self.right[first..], &mut self.right_sums[first..]);
        if let (Some(right), Some(right_sums)) = (right.first_chunk_mut(), right_sums.first_chunk_mut()) {
            update_minima::<N>(sums, right_sums, right);
        }
    }
}

/// Returns the lowest index of the minimum of `cells`.
#[inline(always)]
fn argmin<const N: usize>(cells: &[u8; N]) -> u8 {
    let mut least = u16::MAX;
    for (d, &cell) in cells.iter().enumerate() {
        least = least.min(u16::from(cell) << 8 | d as u16);
    }
    least as u8
}

/// Where a cell is less than its sum, stores it in `sums`, and its disparity in `disparities`.
#[inline(always)]
fn update_minima<const N: usize>(cells: &[u8; N], sums: &mut [u8; N], disparities: &mut [u8; N]) {
    let mut taken = [0; N];
    for d in 0..N {
        // Bit masks instead of a choice, for which the compiler would load from memory conditionally.
        let less = if cells[d] < sums[d] { u8::MAX } else { 0 };
        taken[d] = (d as u8 & less) | (disparities[d] & !less);
    }
    *disparities = taken;
    for d in 0..N {
        sums[d] = sums[d].min(cells[d]);
    }
}

/// Refines a winner to subpixel accuracy, in fixed point, by equiangular line fitting: the minimum of a V with equally
/// steep sides through its sum and the two beside it.
#[inline(always)]
fn subpixel_disparity([d, lower, least, upper]: Winner) -> u16 {
    let [lower, least, upper] = [lower, least, upper].map(f32::from);
    let parts = (lower - upper).abs() * f32::from(ONE / 2) / (lower.max(upper) - least).max(1.0);
    let (whole, parts) = (u16::from(d) * ONE, floor_to_u16(parts));
    if lower < upper { whole - parts } else { whole + parts }
}

/// Rounds down a quotient of less than 256, whose divisor is less than 256, too. Rust's own conversion is not
/// vectorised, because it saturates.
#[inline(always)]
fn floor_to_u16(quotient: f32) -> u16 {
    // Adding this rounds to integers; the lowest bits of the sum are the integer.
    const WHOLE: f32 = 1.5 * (1 << 23) as f32;
    // No quotient is closer to the next integer than this is to a half.
    const HALF: f32 = 0.5 - 1.0 / 512.0;
    (quotient - HALF + WHOLE).to_bits() as u16 & 0xff
}
