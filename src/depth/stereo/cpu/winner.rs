//! Winner takes all, with the left-right consistency check: of each pixel, the disparity that costs least, if the right
//! eye agrees.

use pulp::WithSimd;

use super::super::fixed::{AGREE, ONE, UNKNOWN};
use super::GROUP;

/// The winners of a group of rows.
pub struct Winners<'a, const N: usize> {
    /// Sums of costs, `[column][row][disparity]`.
    pub sums: &'a [u8],
    pub width: usize,
    pub eyes: &'a mut Eyes,
    /// Fixed-point disparities, `[row][column]`: of the rows of the group that there are.
    pub out: &'a mut [u16],
}

/// The disparity that costs least for each pixel of a group, as seen from each eye.
pub struct Eyes {
    /// `[row][column]`.
    left: Vec<u8>,
    /// `[row][column]`, mirrored: from the last column to the first, and after that the columns left of the picture.
    right: Vec<u8>,
    /// The least sums so far, laid out as `right`.
    right_sums: Vec<u8>,
}

impl Eyes {
    /// Memory for rows of so many columns.
    pub fn new(width: usize, disparities: usize) -> Self {
        let right_len = GROUP * (width + disparities);
        Self { left: vec![0; GROUP * width], right: vec![0; right_len], right_sums: vec![0; right_len] }
    }
}

impl<const N: usize> WithSimd for Winners<'_, N> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { sums, width, eyes: Eyes { left, right, right_sums }, out } = self;
        let sums = &sums.as_chunks::<N>().0[..width * GROUP];
        let (rows, right_stride) = (out.len() / width, width + N);
        right_sums.fill(u8::MAX);
        for x in 0..width {
            // Rows alternate: the next column of a row reads sums that this one writes, and would wait for them.
            for row in 0..rows {
                let cells = &sums[x * GROUP + row];
                left[row * width + x] = index_of_least(cells);
                // For each d, column x - d of the right eye, mirrored.
                let first = row * right_stride + width - 1 - x;
                let partners = first..first + N;
                keep_less(cells, &mut right_sums[partners.clone()], &mut right[partners]);
            }
        }
        for (row, out) in out.chunks_exact_mut(width).enumerate() {
            let (left, right) = (&left[row * width..], &right[row * right_stride..]);
            for (x, out) in out.iter_mut().enumerate() {
                let d = usize::from(left[x]);
                let agrees = d <= x && right[width - 1 - x + d].abs_diff(left[x]) <= AGREE;
                *out = if agrees { refine(&sums[x * GROUP + row], d) } else { UNKNOWN };
            }
        }
    }
}

/// The lowest index of the least of `cells`, without branches: vector code.
#[inline(always)]
fn index_of_least<const N: usize>(cells: &[u8; N]) -> u8 {
    let mut least = u8::MAX;
    for &cell in cells {
        least = least.min(cell);
    }
    let mut indices = [0; N];
    for d in 0..N {
        indices[d] = if cells[d] == least { d as u8 } else { u8::MAX };
    }
    let mut index = u8::MAX;
    for d in indices {
        index = index.min(d);
    }
    index
}

/// Where a cell is less than its sum, puts it into `sums`, and its disparity into `disparities`.
#[inline(always)]
fn keep_less<const N: usize>(cells: &[u8; N], sums: &mut [u8], disparities: &mut [u8]) {
    let mut taken = [0; N];
    for d in 0..N {
        taken[d] = if cells[d] < sums[d] { d as u8 } else { disparities[d] };
    }
    disparities.copy_from_slice(&taken);
    for d in 0..N {
        sums[d] = sums[d].min(cells[d]);
    }
}

/// Refines the disparity `d` to parts of a pixel, in fixed point: the minimum of a V with equally steep sides through
/// its cost and those beside it.
#[inline(always)]
fn refine(cells: &[u8], d: usize) -> u16 {
    let whole = d as i32 * i32::from(ONE);
    if d == 0 || d + 1 >= cells.len() {
        return whole as u16;
    }
    let [lower, least, upper] = [cells[d - 1], cells[d], cells[d + 1]].map(i32::from);
    let slope = lower.max(upper) - least;
    if slope == 0 { whole as u16 } else { (whole + (lower - upper) * i32::from(ONE / 2) / slope) as u16 }
}
