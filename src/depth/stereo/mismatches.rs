//! Fills what is not hidden by a nearer object: mismatches, and the left border, which the right camera does not see at
//! all.
//!
//! A gap is an occlusion as far as its farther, left side lies behind the nearer, right one in the right picture, and
//! keeps the disparity of the farther side ([`super::gaps`]). The rest of it was seen by both cameras and not matched
//! (Hirschmüller, *Stereo processing by semiglobal matching and mutual information*, PAMI 2008, section 2.6.3). Geometry
//! does not say what stands there: it is neither before nor behind its neighbours. Each pixel takes the disparity of
//! the nearest known one by geodesic distance: the length of the shortest path plus the changes of brightness on it.

use std::ops::Range;

use super::fixed::{ONE, is_known};
use super::gaps::first_known;

/// Cost of a step along a row, and to another row: most of the border belongs to its neighbours in the row.
const STEP_COST: [u16; 2] = [1, 8];
/// Cost of a change of brightness by one of 255 levels.
const CHANGE_COST: u16 = 2;
/// Rounds of raster sweeps down and up: paths that bend more often are found late, or not at all.
const SWEEPS: usize = 2;

/// Fills the border and mismatches; owns its buffers.
#[derive(Debug, Default)]
pub struct MismatchFiller {
    width: usize,
    /// Length of the shortest path found to each pixel, `[row][column]`; 0 where the disparity is known.
    length: Vec<u16>,
    /// Pixels to fill, as runs of columns, row by row.
    runs: Vec<Range<u32>>,
    /// The runs of each row.
    rows: Vec<Range<usize>>,
    /// First known column of each row; 0 in rows without any disparity, which are not changed.
    first: Vec<usize>,
}

impl MismatchFiller {
    /// Allocates for maps of this size; nothing is allocated later.
    pub fn new((width, height): (usize, usize)) -> Self {
        Self {
            width,
            length: Vec::with_capacity(width * height),
            // Runs have a known pixel between them.
            runs: Vec::with_capacity(width.div_ceil(2) * height),
            rows: Vec::with_capacity(height),
            first: Vec::with_capacity(height),
        }
    }

    /// Returns the first known column of each row of the last map, 0 in rows without any disparity.
    pub fn first_known_columns(&self) -> &[usize] {
        &self.first
    }

    /// Fills the pixels of `map` that are not hidden, by geodesic distance in the left picture `luma`; rows without any
    /// disparity are not changed.
    pub fn fill(&mut self, map: &mut [u16], luma: &[u8]) {
        self.find_runs(map);
        let height = self.rows.len();
        for _ in 0..SWEEPS {
            for y in 0..height {
                self.relax_row(map, luma, y, y.checked_sub(1));
            }
            for y in (0..height).rev() {
                self.relax_row(map, luma, y, Some(y + 1).filter(|&y| y < height));
            }
        }
    }

    /// Finds the pixels to fill.
    fn find_runs(&mut self, map: &[u16]) {
        let Self { width, length, runs, rows, first } = self;
        length.clear();
        length.extend(map.iter().map(|&d| if is_known(d) { 0 } else { u16::MAX }));
        first.clear();
        rows.clear();
        runs.clear();
        for row in map.chunks_exact(*width) {
            let (begin, known) = (runs.len(), first_known(row));
            let mut x = known.unwrap_or(row.len());
            first.push(known.unwrap_or(0));
            if x > 0 && x < row.len() {
                runs.push(0..x as u32);
            }
            while let Some(gap) = row[x..].iter().position(|&d| !is_known(d)) {
                let start = x + gap;
                let end = start + first_known(&row[start..]).unwrap_or(row.len() - start);
                let (left, right) = (row[start - 1], row.get(end).copied().unwrap_or(0));
                let hidden = usize::from(right.saturating_sub(left) / ONE);
                if hidden < end - start {
                    runs.push(start as u32..(end - hidden) as u32);
                }
                x = end;
            }
            rows.push(begin..runs.len());
        }
    }

    /// Relaxes the paths to the pixels to fill of row `y` through their neighbours in the row, on both sides, and in
    /// the adjacent row `other`, and copies the disparity at the start of each shorter path.
    fn relax_row(&mut self, map: &mut [u16], luma: &[u8], y: usize, other: Option<usize>) {
        let (width, length) = (self.width, &mut self.length);
        let mut relax = |x: usize, from_x: usize, from_y: usize| {
            let (to, from) = (y * width + x, from_y * width + from_x);
            let change = u16::from(luma[to].abs_diff(luma[from]));
            let step = STEP_COST[usize::from(from_y != y)] + CHANGE_COST * change;
            let shorter = length[from].saturating_add(step);
            if shorter < length[to] {
                length[to] = shorter;
                map[to] = map[from];
            }
        };
        for run in &self.runs[self.rows[y].clone()] {
            let columns = run.start as usize..run.end as usize;
            for x in columns.clone().rev() {
                let after = x + 1 < width;
                if after {
                    relax(x, x + 1, y);
                }
                if let Some(other) = other {
                    relax(x, x, other);
                    if after {
                        relax(x, x + 1, other);
                    }
                    if x > 0 {
                        relax(x, x - 1, other);
                    }
                }
            }
            for x in columns.skip(usize::from(run.start == 0)) {
                relax(x, x - 1, y);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixed::{FILLED, UNKNOWN};
    use super::super::gaps::fill_row;
    use super::*;

    /// Fills rows of these disparities, in pixels (-1: not matched), in a picture of this brightness.
    fn fill(rows: &[&[i32]], luma: &[u8]) -> Vec<i32> {
        let width = rows[0].len();
        let mut map: Vec<u16> =
            rows.iter().flat_map(|row| row.iter().map(|&px| if px < 0 { UNKNOWN } else { px as u16 * ONE })).collect();
        for row in map.chunks_exact_mut(width) {
            let first = first_known(row).unwrap_or(width);
            fill_row(&mut row[first..], FILLED);
        }
        MismatchFiller::new((width, rows.len())).fill(&mut map, luma);
        map.into_iter().map(|d| if d == UNKNOWN { -1 } else { i32::from((d & !FILLED) / ONE) }).collect()
    }

    #[test]
    fn the_hidden_part_of_a_gap_keeps_the_farther_side_and_the_rest_takes_that_of_its_brightness() {
        // Four pixels of the far surface lie behind the near one, which is 4 px nearer; all are as bright as that.
        let rows: [&[i32]; 2] = [&[6; 9], &[2, -1, -1, -1, -1, -1, -1, 6, 6]];
        let luma = [200, 200, 200, 200, 200, 200, 200, 200, 200, 9, 200, 200, 200, 200, 200, 200, 200, 200];
        assert_eq!(fill(&rows, &luma)[9..], [2, 6, 6, 2, 2, 2, 2, 6, 6]);
        // A nearer surface on the left hides nothing from the right camera.
        let luma = [200, 200, 200, 9, 9, 9];
        assert_eq!(fill(&[&[6, -1, -1, -1, 2, 2]], &luma), [6, 6, 6, 2, 2, 2]);
    }

    #[test]
    fn borders_take_what_is_nearest_and_rows_without_a_match_stay() {
        let luma = [9, 9, 9, 9, 9, 200, 200, 9, 9, 9, 9, 9];
        let rows: [&[i32]; 3] = [&[-1, -1, 3, -1], &[-1, -1, -1, 5], &[-1, -1, -1, -1]];
        assert_eq!(fill(&rows, &luma), [3, 3, 3, 3, 3, 5, 5, 5, -1, -1, -1, -1]);
        assert_eq!(fill(&[&[-1; 4]], &[0; 4]), [-1; 4]);
    }
}
