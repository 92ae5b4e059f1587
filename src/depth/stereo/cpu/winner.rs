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

/// What each eye takes for the disparity of each pixel of a group.
pub struct Eyes {
    /// `[row][column]`.
    left: Vec<u8>,
    /// `[row][column]`, from the last column to the first, and beyond that what would lie outside.
    right: Vec<u8>,
    /// The sums of the right eye's.
    right_sums: Vec<u8>,
}

impl Eyes {
    /// Memory for rows of so many columns.
    pub fn new(width: usize, disparities: usize) -> Self {
        let beyond = GROUP * (width + disparities);
        Self { left: vec![0; GROUP * width], right: vec![0; beyond], right_sums: vec![0; beyond] }
    }
}

impl<const N: usize> WithSimd for Winners<'_, N> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { sums, width, eyes: Eyes { left, right, right_sums }, out } = self;
        let sums = &sums.as_chunks::<N>().0[..width * GROUP];
        let (rows, beyond) = (out.len() / width, width + N);
        right_sums.fill(u8::MAX);
        for x in 0..width {
            // The rows take turns: what one has just written is not yet there to be read.
            for row in 0..rows {
                let cells = &sums[x * GROUP + row];
                left[row * width + x] = place_of_least(cells);
                // Column x - d of the right eye, mirrored.
                let first = row * beyond + width - 1 - x;
                let seen = first..first + N;
                prefer(cells, &mut right_sums[seen.clone()], &mut right[seen]);
            }
        }
        for (row, out) in out.chunks_exact_mut(width).enumerate() {
            let (left, right) = (&left[row * width..], &right[row * beyond..]);
            for (x, out) in out.iter_mut().enumerate() {
                let d = usize::from(left[x]);
                let agrees = d <= x && right[width - 1 - x + d].abs_diff(left[x]) <= AGREE;
                *out = if agrees { between(&sums[x * GROUP + row], d) } else { UNKNOWN };
            }
        }
    }
}

/// The lowest place of the least of `cells`.
#[inline(always)]
fn place_of_least<const N: usize>(cells: &[u8; N]) -> u8 {
    let mut least = u8::MAX;
    for &cell in cells {
        least = least.min(cell);
    }
    let mut places = [0; N];
    for d in 0..N {
        places[d] = if cells[d] == least { d as u8 } else { u8::MAX };
    }
    let mut place = u8::MAX;
    for d in places {
        place = place.min(d);
    }
    place
}

/// Where a cell is less than `sums`, it and its place are taken.
#[inline(always)]
fn prefer<const N: usize>(cells: &[u8; N], sums: &mut [u8], places: &mut [u8]) {
    let mut taken = [0; N];
    for d in 0..N {
        taken[d] = if cells[d] < sums[d] { d as u8 } else { places[d] };
    }
    places.copy_from_slice(&taken);
    for d in 0..N {
        sums[d] = sums[d].min(cells[d]);
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
