//! The matching cost: Hamming distance of the census codes of a left and a right pixel, aggregated over 3x3 pixels.
//!
//! twin: shaders/stereo/cost.wgsl

use super::super::fixed::{OUTSIDE_COST, PRIOR_BONUS};
use super::GROUP;
use super::census::PLANES;
use crate::compute::aligned::CacheAligned;

/// Rows of codes that the costs of a group need: one more above and one below.
pub const ROWS: usize = GROUP + 2;

/// Census planes of a left row, and of the right one in mirrored order.
pub type CensusCodes<'a> = [[&'a [u8]; PLANES]; 2];

/// Computes the costs of a group of rows, 0 to 27, from the last column to the first: an eighth of the sum of the
/// distances over three rows and columns.
pub struct Costs<'a, const N: usize> {
    /// From the row above the group to the one below it.
    codes: [CensusCodes<'a>; ROWS],
    width: usize,
    /// Distances summed over three rows: of the column whose costs are next, and of it plus the one right of it.
    column_sums: CacheAligned<[[u8; N]; GROUP]>,
    pair_sums: CacheAligned<[[u8; N]; GROUP]>,
}

impl<'a, const N: usize> Costs<'a, N> {
    #[inline(always)]
    pub fn new(mut codes: [CensusCodes<'a>; ROWS], width: usize) -> Self {
        // Slices of equal length need only one bounds check.
        for [left, right] in &mut codes {
            for plane in 0..PLANES {
                left[plane] = &left[plane][..width];
                right[plane] = &right[plane][..width + N];
            }
        }
        let mut first =
            Self { codes, width, column_sums: CacheAligned([[0; N]; GROUP]), pair_sums: CacheAligned([[0; N]; GROUP]) };
        // Beyond the borders the outermost columns repeat.
        first.advance(width - 1);
        first.advance(width - 1);
        first
    }

    /// Returns the costs of column `x` in each row; columns must be requested from the last to the first.
    #[inline(always)]
    pub fn next_column(&mut self, x: usize) -> CacheAligned<[[u8; N]; GROUP]> {
        self.advance(x.saturating_sub(1))
    }

    /// Adds the distances of column `x` to the running sums; returns the costs of the column right of it.
    #[inline(always)]
    fn advance(&mut self, x: usize) -> CacheAligned<[[u8; N]; GROUP]> {
        // The partner at disparity d is in column x - d, which is this one plus d in the mirrored row.
        let first = self.width - 1 - x;
        let mut left = [[0; PLANES]; ROWS];
        let mut right = [[&[0; N]; PLANES]; ROWS];
        for row in 0..ROWS {
            for plane in 0..PLANES {
                left[row][plane] = self.codes[row][0][plane][x];
                right[row][plane] = first_values(&self.codes[row][1][plane][first..]);
            }
        }
        let (numbers, last_inside) = (disparity_bytes::<N>(), x.min(N - 1) as u8);
        let mut costs = CacheAligned([[0; N]; GROUP]);
        for d in 0..N {
            let mut distances = [0; ROWS];
            for row in 0..ROWS {
                let [a, b, c] = left[row];
                let [of_a, of_b, of_c] = right[row];
                let bits = count_bits(a ^ of_a[d], b ^ of_b[d], c ^ of_c[d]);
                distances[row] = if numbers[d] > last_inside { OUTSIDE_COST } else { bits };
            }
            for row in 0..GROUP {
                let next = distances[row] + distances[row + 1] + distances[row + 2];
                costs.0[row][d] = (self.pair_sums.0[row][d] + next + 4) >> 3;
                self.pair_sums.0[row][d] = self.column_sums.0[row][d] + next;
                self.column_sums.0[row][d] = next;
            }
        }
        costs
    }
}

/// Counts the bits of three bytes, 0 to 24.
#[inline(always)]
fn count_bits(a: u8, b: u8, c: u8) -> u8 {
    // A carry-save adder: the population counts of two bytes suffice for three.
    let (ones, twos) = (a ^ b ^ c, (a & b) | (c & (a | b)));
    ones.count_ones() as u8 + 2 * twos.count_ones() as u8
}

/// Returns the reduction of a pixel's cost by disparity: [`PRIOR_BONUS`] for the likely disparity and those one above
/// and below it. `likely` is one more than the likely disparity, or 0 without one.
#[inline(always)]
pub fn prior_bonus(likely: u16) -> impl Fn(u8) -> u8 {
    let (near, bonus) = (likely.wrapping_sub(1) as u8, if likely > 0 { PRIOR_BONUS } else { 0 });
    // Not `abs_diff`, which is computed in 32 bits.
    move |d| if d.max(near) - d.min(near) <= 1 { bonus } else { 0 }
}

/// Returns the first `N` values.
#[inline(always)]
fn first_values<const N: usize>(values: &[u8]) -> &[u8; N] {
    values.first_chunk().expect("rows are long enough")
}

/// Returns the disparities as bytes. They are read from memory, because the compiler compares a loop index in 64 bits,
/// whatever it is converted to.
#[inline(always)]
pub fn disparity_bytes<const N: usize>() -> &'static [u8; N] {
    static NUMBERS: CacheAligned<[u8; 256]> = {
        let mut numbers = [0; 256];
        let mut d = 0;
        while d < numbers.len() {
            numbers[d] = d as u8;
            d += 1;
        }
        CacheAligned(numbers)
    };
    first_values(&NUMBERS.0)
}
