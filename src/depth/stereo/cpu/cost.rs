//! What it costs to say that a pixel has a disparity: the bits in which the census of both eyes differs, averaged over
//! 3x3 pixels.

use pulp::WithSimd;

use super::census::PLANES;

/// The cost of a partner beyond the border of the right picture: that of a poor one, so that the outermost columns may
/// take the disparity of their neighbours.
const OUTSIDE: u8 = 8;

/// Differences of one row, `[column][disparity]`, 0 to 24.
pub struct Differences<'a, const L: usize> {
    /// The census of the left row.
    pub left: [&'a [u8]; PLANES],
    /// The census of the right row from its last column to its first.
    pub right: [&'a [u8]; PLANES],
    /// Columns.
    pub width: usize,
    /// Disparities, a multiple of `L`.
    pub disparities: usize,
    /// At least `width * disparities`.
    pub out: &'a mut [u8],
}

impl<const L: usize> WithSimd for Differences<'_, L> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { left, right, width, disparities, out } = self;
        for (x, cells) in out.chunks_exact_mut(disparities).take(width).enumerate() {
            // The partner at disparity d is in column x - d, which is this one plus d in the mirrored row.
            let first = width - 1 - x;
            for (block, cells) in cells.as_chunks_mut::<L>().0.iter_mut().enumerate() {
                *cells = [0; L];
                for plane in 0..PLANES {
                    let code = left[plane][x];
                    let partners = &right[plane][first + block * L..][..L];
                    for (cell, &partner) in cells.iter_mut().zip(partners) {
                        *cell += (code ^ partner).count_ones() as u8;
                    }
                }
            }
            if x + 1 < disparities {
                cells[x + 1..].fill(OUTSIDE);
            }
        }
    }
}

/// The costs of one row, 0 to 27: an eighth of the sum of the differences in three rows and columns.
pub struct Costs<'a, const L: usize> {
    /// The differences of the rows above, here, and below.
    pub rows: [&'a [u8]; 3],
    /// Columns.
    pub width: usize,
    /// Disparities, a multiple of `L`.
    pub disparities: usize,
    /// At least `width * disparities`.
    pub out: &'a mut [u8],
}

impl<const L: usize> WithSimd for Costs<'_, L> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { rows, width, disparities, out } = self;
        for block in 0..disparities / L {
            let at = |x: usize| x * disparities + block * L;
            let mut before = column::<L>(rows, at(0));
            let mut here = before;
            for x in 0..width {
                let after = column::<L>(rows, at((x + 1).min(width - 1)));
                let out = &mut out[at(x)..at(x) + L];
                for i in 0..L {
                    out[i] = (before[i] + here[i] + after[i] + 4) >> 3;
                }
                (before, here) = (here, after);
            }
        }
    }
}

/// The sum of the three rows at `at`.
#[inline(always)]
fn column<const L: usize>(rows: [&[u8]; 3], at: usize) -> [u8; L] {
    let mut sum = [0; L];
    let [above, here, below] = rows;
    let (above, here, below) = (&above[at..at + L], &here[at..at + L], &below[at..at + L]);
    for i in 0..L {
        sum[i] = above[i] + here[i] + below[i];
    }
    sum
}
