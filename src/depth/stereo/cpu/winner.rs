//! Of each pixel, the disparity that costs least, if the right eye agrees.

use pulp::WithSimd;

use crate::depth::stereo::fixed::{ONE, UNKNOWN};

/// Left and right may differ by this much.
const AGREE: u16 = 1;

/// The winners of one row.
pub struct Winners<'a, const L: usize> {
    /// Sums of costs, `[column][disparity]`.
    pub sums: &'a [u8],
    /// Columns.
    pub width: usize,
    /// Disparities, a multiple of `L`, at most 256.
    pub disparities: usize,
    /// Memory of `width` values, and of `width + disparities`.
    pub best: [&'a mut [u16]; 2],
    /// Fixed-point disparities, `width` of them.
    pub out: &'a mut [u16],
}

impl<const L: usize> WithSimd for Winners<'_, L> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { sums, width, disparities, best: [left, right], out } = self;
        right.fill(u16::MAX);
        // A sum above its disparity: the least of these is the least sum, at the lowest disparity that has it.
        let mut places = [0u16; L];
        for (i, place) in places.iter_mut().enumerate() {
            *place = i as u16;
        }
        for (x, cells) in sums.chunks_exact(disparities).take(width).enumerate() {
            let mut lowest = [u16::MAX; L];
            // Column x - d of the right eye, mirrored.
            let seen = &mut right[width - 1 - x..][..disparities];
            let blocks = cells.as_chunks::<L>().0.iter().zip(seen.as_chunks_mut::<L>().0);
            for (block, (cells, seen)) in blocks.enumerate() {
                for i in 0..L {
                    let key = (u16::from(cells[i]) << 8) | (places[i] + (block * L) as u16);
                    lowest[i] = lowest[i].min(key);
                    seen[i] = seen[i].min(key);
                }
            }
            let mut least = u16::MAX;
            for key in lowest {
                least = least.min(key);
            }
            left[x] = least;
        }
        for (x, out) in out.iter_mut().enumerate() {
            let disparity = left[x] & 0xff;
            let d = usize::from(disparity);
            let agrees = d <= x && (right[width - 1 - x + d] & 0xff).abs_diff(disparity) <= AGREE;
            let cells = &sums[x * disparities..][..disparities];
            *out = if agrees { between(cells, d) } else { UNKNOWN };
        }
    }
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
