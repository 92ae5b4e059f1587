//! Occlusion filling from the background: what only one eye sees lies behind what hides it from the other, so gaps take
//! the farther one of the disparities left and right of them.

use super::fixed::UNKNOWN;
use crate::compute::bands::Bands;
use crate::compute::thread_pool::ThreadPool;

/// Fills the gaps of a row; one without any disparity stays as it is.
pub fn fill_row(row: &mut [u16]) {
    let mut x = 0;
    while x < row.len() {
        if row[x] != UNKNOWN {
            x += 1;
            continue;
        }
        let length = row[x..].iter().position(|&d| d != UNKNOWN).unwrap_or(row.len() - x);
        let left = x.checked_sub(1).map_or(UNKNOWN, |before| row[before]);
        let right = row.get(x + length).copied().unwrap_or(UNKNOWN);
        // The smaller disparity is farther, and UNKNOWN is the largest number: at a border the only side wins.
        row[x..x + length].fill(left.min(right));
        x += length;
    }
}

/// Fills all gaps of `map`: along rows, and rows without any disparity from the nearest one above, or else below. A map
/// without any becomes 0.
pub fn fill(map: &mut [u16], width: usize, workers: &mut ThreadPool) {
    let height = map.len() / width;
    let bands = Bands::new(height, 1, workers).split(map, width);
    workers.run_each(bands, &|band: &mut [u16]| band.chunks_exact_mut(width).for_each(fill_row));
    // A row is now full or empty: one pixel tells which.
    let Some(first) = (0..height).find(|&y| map[y * width] != UNKNOWN) else { return map.fill(0) };
    for y in (0..first).rev() {
        map.copy_within((y + 1) * width..(y + 2) * width, y * width);
    }
    for y in first + 1..height {
        if map[y * width] == UNKNOWN {
            map.copy_within((y - 1) * width..y * width, y * width);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_take_the_farther_side_and_empty_rows_their_neighbour() {
        const U: u16 = UNKNOWN;
        let mut map = vec![U, U, U, U, U, U, 5, U, 9, U, U, U, U, U, U];
        let mut workers = ThreadPool::new("test", 2);
        fill(&mut map, 5, &mut workers);
        assert_eq!(map, [5, 5, 5, 9, 9].repeat(3));
        let mut none = vec![U; 6];
        fill(&mut none, 3, &mut workers);
        assert_eq!(none, [0; 6]);
    }
}
