//! Of each pixel, the disparity that costs least, if the right eye agrees.

use pulp::WithSimd;

use super::GROUP;
use super::super::fixed::{ONE, UNKNOWN};

/// Left and right may differ by this much.
const AGREE: u16 = 1;
/// Disparities that are compared at once, where their number allows it.
const LANES: usize = 32;

/// The winners of a group of rows.
pub struct Winners<'a, const N: usize> {
    /// Sums of costs, `[column][row][disparity]`.
    pub sums: &'a [u8],
    /// Columns.
    pub width: usize,
    /// Memory of `GROUP` times `width` values, and of `GROUP` times `width + N`.
    pub best: [&'a mut [u16]; 2],
    /// Fixed-point disparities, `[row][column]`: of the rows of the group that there are.
    pub out: &'a mut [u16],
}

impl<const N: usize> WithSimd for Winners<'_, N> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { sums, width, best: [left, right], out } = self;
        let sums = sums.as_chunks::<N>().0;
        let (rows, seen) = (out.len() / width, width + N);
        right.fill(u16::MAX);
        for x in 0..width {
            // The rows take turns: what one has just written is not yet there to be read.
            for row in 0..rows {
                let cells = &sums[x * GROUP + row];
                // Column x - d of the right eye, mirrored.
                let seen = &mut right[row * seen + width - 1 - x..][..N];
                left[row * width + x] = if N.is_multiple_of(LANES) {
                    least::<LANES>(cells, seen)
                } else {
                    least::<16>(cells, seen)
                };
            }
        }
        for (row, out) in out.chunks_exact_mut(width).enumerate() {
            let (left, right) = (&left[row * width..], &right[row * seen..]);
            for (x, out) in out.iter_mut().enumerate() {
                let disparity = left[x] & 0xff;
                let d = usize::from(disparity);
                let agrees = d <= x && (right[width - 1 - x + d] & 0xff).abs_diff(disparity) <= AGREE;
                *out = if agrees { between(&sums[x * GROUP + row], d) } else { UNKNOWN };
            }
        }
    }
}

/// The least key of `cells`: a sum above its disparity, so that of the least sums the one at the lowest disparity is
/// taken. `seen` takes the keys that are less than its own.
#[inline(always)]
fn least<const L: usize>(cells: &[u8], seen: &mut [u16]) -> u16 {
    let mut lowest = [u16::MAX; L];
    let blocks = cells.as_chunks::<L>().0.iter().zip(seen.as_chunks_mut::<L>().0);
    for (block, (cells, seen)) in blocks.enumerate() {
        for i in 0..L {
            let key = (u16::from(cells[i]) << 8) | (block * L + i) as u16;
            lowest[i] = lowest[i].min(key);
            seen[i] = seen[i].min(key);
        }
    }
    let mut least = u16::MAX;
    for key in lowest {
        least = least.min(key);
    }
    least
}

/// The place of the least cost between the disparities beside `d`, in fixed point: where two lines of one slope meet.
#[inline(always)]
fn between(cells: &[u8], d: usize) -> u16 {
    let whole = d as i32 * i32::from(ONE);
    if d == 0 || d + 1 >= cells.len() {
        return whole as u16;
    }
    let [below, least, above] = [cells[d - 1], cells[d], cells[d + 1]].map(i32::from);
    let slope = below.max(above) - least;
    if slope == 0 { whole as u16 } else { (whole + (below - above) * i32::from(ONE / 2) / slope) as u16 }
}
