//! The matching cost of a disparity at a pixel: the bits in which the census codes of both eyes differ (their Hamming
//! distance), averaged over 3x3 pixels.

use pulp::WithSimd;

use super::super::fixed::{BONUS, OUTSIDE};
use super::GROUP;
use super::census::PLANES;

/// Rows whose differences the costs of a group are made of: one more above and one below.
pub const ROWS: usize = GROUP + 2;

/// Census of a left row, and of the right one from its last column to its first.
pub type Codes<'a> = [[&'a [u8]; PLANES]; 2];

/// The costs of a group of rows, 0 to 27: an eighth of the sum of the differences over three rows and columns.
pub struct Costs<'a, const N: usize> {
    /// From the row above the group to the one below it.
    pub codes: [Codes<'a>; ROWS],
    pub width: usize,
    /// `[column][row][disparity]`, at least `width * GROUP * N`.
    pub out: &'a mut [u8],
}

impl<const N: usize> WithSimd for Costs<'_, N> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { codes, width, out } = self;
        let out = out.as_chunks_mut::<N>().0;
        // Sums over three rows, of the columns before, here, and after.
        let mut before = [[0u8; N]; GROUP];
        let mut here = [[0u8; N]; GROUP];
        let mut after = [[0u8; N]; GROUP];
        sum_rows(&codes, width, 0, &mut here);
        // Beyond the borders the outermost columns repeat.
        before.copy_from_slice(&here);
        after.copy_from_slice(&here);
        for x in 0..width {
            if x + 1 < width {
                sum_rows(&codes, width, x + 1, &mut after);
            }
            for row in 0..GROUP {
                let out = &mut out[x * GROUP + row];
                let (before, here, after) = (&mut before[row], &mut here[row], &after[row]);
                for d in 0..N {
                    out[d] = (before[d] + here[d] + after[d] + 4) >> 3;
                    before[d] = here[d];
                    here[d] = after[d];
                }
            }
        }
    }
}

/// Lowers the costs of each pixel's likely disparity, and of the two beside it, by [`BONUS`]. `likely`, `[row][column]`
/// of the group, has one more than that disparity, or 0 where none is.
pub fn favour<const N: usize>(likely: &[u16], width: usize, costs: &mut [u8]) {
    let costs = costs.as_chunks_mut::<N>().0;
    for (row, likely) in likely.chunks_exact(width).enumerate() {
        for (&likely, costs) in likely.iter().zip(costs.iter_mut().skip(row).step_by(GROUP)) {
            let likely = usize::from(likely);
            if likely > 0 {
                for cost in &mut costs[likely.saturating_sub(2)..(likely + 1).min(N)] {
                    *cost = cost.saturating_sub(BONUS);
                }
            }
        }
    }
}

/// For each row of the group, the differences of column `x` summed over it and the rows above and below, 0 to 72.
#[inline(always)]
fn sum_rows<const N: usize>(codes: &[Codes; ROWS], width: usize, x: usize, sums: &mut [[u8; N]; GROUP]) {
    // The differences of the last two rows.
    let mut last = [[0u8; N]; 2];
    for (k, codes) in codes.iter().enumerate() {
        let present = differences::<N>(codes, width, x);
        for d in 0..N {
            if k >= 2 {
                sums[k - 2][d] = last[0][d] + last[1][d] + present[d];
            }
            last[0][d] = last[1][d];
            last[1][d] = present[d];
        }
    }
}

/// The bits that differ between pixel `x` and each partner, 0 to 24.
#[inline(always)]
fn differences<const N: usize>([left, right]: &Codes, width: usize, x: usize) -> [u8; N] {
    // The partner at disparity d is in column x - d, which is this one plus d in the mirrored row.
    let first = width - 1 - x;
    let [a, b, c] = left.map(|plane| plane[x]);
    let [of_a, of_b, of_c] = right;
    let (of_a, of_b, of_c) = (&of_a[first..first + N], &of_b[first..first + N], &of_c[first..first + N]);
    let mut out = [0u8; N];
    for d in 0..N {
        let (a, b, c) = (a ^ of_a[d], b ^ of_b[d], c ^ of_c[d]);
        // Bits add up to ones and twos, so that two bytes are counted for three.
        let (ones, twos) = (a ^ b ^ c, (a & b) | (c & (a ^ b)));
        out[d] = ones.count_ones() as u8 + 2 * twos.count_ones() as u8;
    }
    if x + 1 < N {
        for (d, out) in out.iter_mut().enumerate() {
            *out = if d > x { OUTSIDE } else { *out };
        }
    }
    out
}
