//! The left border, which the right eye does not see at all.
//!
//! No rule of geometry says what stands there: it is neither before nor behind what is next to it. Each pixel takes the
//! disparity of the known one that is nearest along a way through the picture on which brightness changes little.

use super::fixed::is_known;
use super::gaps::first_known;

/// Cost of a step along a row, and to another row: most of the border belongs to what is beside it.
const STEP: [u16; 2] = [1, 8];
/// Cost of a change of brightness by one of 255 levels.
const CHANGE: u16 = 2;
/// Rounds of sweeps: ways that bend more often than this are found late, or not.
const ROUNDS: usize = 2;

/// Fills the border; owns the memory for it.
#[derive(Debug, Default)]
pub struct Border {
    /// Length of the best way from each pixel of the strip, `[row][column]`.
    length: Vec<u16>,
    /// First known column of each row; 0 in rows without any disparity, which are left as they are.
    first: Vec<usize>,
}

impl Border {
    /// For maps of this size: no memory is taken later.
    pub fn new((width, height): (usize, usize)) -> Self {
        Self { length: Vec::with_capacity(width * height), first: Vec::with_capacity(height) }
    }

    /// The first known column of each row of the map that was filled last, 0 in rows without any disparity.
    pub fn first(&self) -> &[usize] {
        &self.first
    }

    /// Gives the pixels of `map` left of the first known one of their row the disparity of a pixel that looks alike.
    /// `luma` is the left picture; rows without any disparity stay as they are.
    pub fn fill(&mut self, map: &mut [u16], luma: &[u8], width: usize) {
        self.first.clear();
        self.first.extend(map.chunks_exact(width).map(|row| first_known(row).unwrap_or(0)));
        // The strip reaches to the first known column of the row where that is farthest.
        let columns = self.first.iter().max().map_or(0, |&most| (most + 1).min(width));
        if columns < 2 {
            return;
        }
        self.length.clear();
        for &first in &self.first {
            self.length.extend((0..columns).map(|x| if x < first { u16::MAX } else { 0 }));
        }
        let height = self.first.len();
        for _ in 0..ROUNDS {
            for y in 0..height {
                self.sweep(map, luma, width, columns, y, y.checked_sub(1));
            }
            for y in (0..height).rev() {
                self.sweep(map, luma, width, columns, y, Some(y + 1).filter(|&y| y < height));
            }
        }
    }

    /// Shortens the ways to the pixels of row `y`, and copies the disparity at their start: by way of the neighbours in
    /// the row, on both sides, and in the adjacent row `other`.
    fn sweep(&mut self, map: &mut [u16], luma: &[u8], width: usize, columns: usize, y: usize, other: Option<usize>) {
        let mut try_way = |x: usize, from_x: usize, from_y: usize| {
            let (to, from) = (y * width + x, from_y * width + from_x);
            let so_far = self.length[from_y * columns + from_x];
            let change = u16::from(luma[to].abs_diff(luma[from]));
            let length = so_far.saturating_add(STEP[usize::from(from_y != y)] + CHANGE * change);
            // Rows without any disparity and gaps have length 0 and nothing to give.
            if length < self.length[y * columns + x] && is_known(map[from]) {
                self.length[y * columns + x] = length;
                map[to] = map[from];
            }
        };
        let end = self.first[y].min(columns - 1);
        for x in (0..end).rev() {
            try_way(x, x + 1, y);
            if let Some(other) = other {
                try_way(x, x, other);
                try_way(x, x + 1, other);
                if x > 0 {
                    try_way(x, x - 1, other);
                }
            }
        }
        for x in 1..end {
            try_way(x, x - 1, y);
        }
    }
}
