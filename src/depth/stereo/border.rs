//! Fills the left border, which the right camera does not see at all.
//!
//! Geometry does not say what stands there: it is neither before nor behind its neighbours. Each pixel takes the
//! disparity of the nearest known one by geodesic distance: the length of the shortest path plus the changes of
//! brightness on it.

use super::fixed::is_known;
use super::gaps::first_known;

/// Cost of a step along a row, and to another row: most of the border belongs to its neighbours in the row.
const STEP_COST: [u16; 2] = [1, 8];
/// Cost of a change of brightness by one of 255 levels.
const CHANGE_COST: u16 = 2;
/// Rounds of raster sweeps down and up: paths that bend more often are found late, or not at all.
const SWEEPS: usize = 2;

/// Fills the border; owns its buffers.
#[derive(Debug, Default)]
pub struct BorderFiller {
    /// Length of the shortest path found to each pixel of the strip, `[row][column]`.
    length: Vec<u16>,
    /// First known column of each row; 0 in rows without any disparity, which are not changed.
    first: Vec<usize>,
}

impl BorderFiller {
    /// Allocates for maps of this size; nothing is allocated later.
    pub fn new((width, height): (usize, usize)) -> Self {
        Self { length: Vec::with_capacity(width * height), first: Vec::with_capacity(height) }
    }

    /// Returns the first known column of each row of the last map, 0 in rows without any disparity.
    pub fn first_known_columns(&self) -> &[usize] {
        &self.first
    }

    /// Fills the pixels of `map` left of the first known one of their row by geodesic distance in the left picture
    /// `luma`; rows without any disparity are not changed.
    pub fn fill(&mut self, map: &mut [u16], luma: &[u8], width: usize) {
        self.first.clear();
        self.first.extend(map.chunks_exact(width).map(|row| first_known(row).unwrap_or(0)));
        // The strip extends to the largest of the first known columns.
        let columns = self.first.iter().max().map_or(0, |&most| (most + 1).min(width));
        if columns < 2 {
            return;
        }
        self.length.clear();
        for &first in &self.first {
            self.length.extend((0..columns).map(|x| if x < first { u16::MAX } else { 0 }));
        }
        let height = self.first.len();
        for _ in 0..SWEEPS {
            for y in 0..height {
                self.relax_row(map, luma, width, columns, y, y.checked_sub(1));
            }
            for y in (0..height).rev() {
                self.relax_row(map, luma, width, columns, y, Some(y + 1).filter(|&y| y < height));
            }
        }
    }

    /// Relaxes the paths to the pixels of row `y` through their neighbours in the row, on both sides, and in the
    /// adjacent row `other`, and copies the disparity at the start of each shorter path.
    fn relax_row(
        &mut self,
        map: &mut [u16],
        luma: &[u8],
        width: usize,
        columns: usize,
        y: usize,
        other: Option<usize>,
    ) {
        let mut relax = |x: usize, from_x: usize, from_y: usize| {
            let (to, from) = (y * width + x, from_y * width + from_x);
            let so_far = self.length[from_y * columns + from_x];
            let change = u16::from(luma[to].abs_diff(luma[from]));
            let length = so_far.saturating_add(STEP_COST[usize::from(from_y != y)] + CHANGE_COST * change);
            // Rows without any disparity and gaps have length 0 but no disparity to copy.
            if length < self.length[y * columns + x] && is_known(map[from]) {
                self.length[y * columns + x] = length;
                map[to] = map[from];
            }
        };
        let end = self.first[y].min(columns - 1);
        for x in (0..end).rev() {
            relax(x, x + 1, y);
            if let Some(other) = other {
                relax(x, x, other);
                relax(x, x + 1, other);
                if x > 0 {
                    relax(x, x - 1, other);
                }
            }
        }
        for x in 1..end {
            relax(x, x - 1, y);
        }
    }
}
