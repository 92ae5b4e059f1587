//! Winner takes all, with the left-right consistency check: of each pixel, the disparity that costs least, if the right
//! eye agrees.

use super::super::fixed::{AGREE, ONE, UNKNOWN};
use super::GROUP;

/// The disparity that costs least for each pixel of a group of rows, as seen from each eye.
pub struct Eyes {
    width: usize,
    /// `[row][column]`.
    left: Vec<u8>,
    /// The same refined, in fixed point.
    refined: Vec<u16>,
    /// `[row][column]`, mirrored: from the last column to the first, and after that the columns left of the picture.
    right: Vec<u8>,
    /// The least sums so far, laid out as `right`.
    right_sums: Vec<u8>,
}

impl Eyes {
    /// Memory for rows of so many columns.
    pub fn new(width: usize, disparities: usize) -> Self {
        let (left_len, right_len) = (GROUP * width, GROUP * (width + disparities));
        let (left, refined) = (vec![0; left_len], vec![0; left_len]);
        Self { width, left, refined, right: vec![0; right_len], right_sums: vec![0; right_len] }
    }

    /// Begins a group of rows.
    pub fn clear(&mut self) {
        self.right_sums.fill(u8::MAX);
    }

    /// Takes the sums of pixel `x` of a row; the least of them is `least`. Pixels of a row are taken from the left.
    #[inline(always)]
    pub fn take<const N: usize>(&mut self, row: usize, x: usize, sums: &[u8; N], least: u8) {
        let d = index_of(sums, least);
        let pixel = row * self.width + x;
        self.left[pixel] = d;
        self.refined[pixel] = refine(sums, d.into());
        // For each d, column x - d of the right eye, mirrored.
        let first = row * (self.width + N) + self.width - 1 - x;
        let partners = first..first + N;
        keep_less(sums, &mut self.right_sums[partners.clone()], &mut self.right[partners]);
    }

    /// Writes the fixed-point disparities that both eyes agree on to `out`, `[row][column]`.
    pub fn agreed(&self, out: &mut [u16]) {
        let Self { width, left, refined, right, .. } = self;
        let width = *width;
        let right_stride = right.len() / GROUP;
        for (row, out) in out.chunks_exact_mut(width).enumerate() {
            let (left, refined) = (&left[row * width..][..width], &refined[row * width..][..width]);
            let right = &right[row * right_stride..];
            for x in 0..width {
                let d = usize::from(left[x]);
                let agrees = d <= x && right[width - 1 - x + d].abs_diff(left[x]) <= AGREE;
                out[x] = if agrees { refined[x] } else { UNKNOWN };
            }
        }
    }
}

/// The lowest index of `least`, without branches: vector code.
#[inline(always)]
fn index_of<const N: usize>(cells: &[u8; N], least: u8) -> u8 {
    let mut index = u8::MAX;
    for d in 0..N {
        index = index.min(if cells[d] == least { d as u8 } else { u8::MAX });
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
