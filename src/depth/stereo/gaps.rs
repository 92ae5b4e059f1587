//! Occlusion filling from the background: a pixel that only one camera sees lies behind the object that hides it from
//! the other, so gaps take the farther one of the disparities left and right of them.
//!
//! twin: shaders/stereo/gaps.wgsl

use super::fixed::{UNKNOWN, is_known};

/// Returns the first column of a row with a known disparity.
pub fn first_known(row: &[u16]) -> Option<usize> {
    row.iter().position(|&d| is_known(d))
}

/// Fills the gaps of a row and sets the bits of `mark` in them; a row without any disparity is not changed.
pub fn fill_row(row: &mut [u16], mark: u16) {
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
        row[x..x + length].fill(left.min(right) | mark);
        x += length;
    }
}

/// Fills rows of `map` without any disparity from the nearest one above, or else below; all others must be full. A map
/// without any disparity becomes 0.
pub fn fill_empty_rows(map: &mut [u16], width: usize) {
    let height = map.len() / width;
    // Rows are full or empty, so their first pixel decides.
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
    use super::super::fixed::FILLED;
    use super::*;

    #[test]
    fn gaps_take_the_farther_side_and_empty_rows_their_neighbour() {
        const U: u16 = UNKNOWN;
        let mut map = vec![U, U, U, U, U, U, 5, U, 9, U, U, U, U, U, U];
        map.chunks_exact_mut(5).for_each(|row| fill_row(row, 0));
        fill_empty_rows(&mut map, 5);
        assert_eq!(map, [5, 5, 5, 9, 9].repeat(3));
        let mut none = vec![U; 6];
        fill_empty_rows(&mut none, 3);
        assert_eq!(none, [0; 6]);
        let mut marked = vec![5, U, U, 9, U];
        fill_row(&mut marked, FILLED);
        assert_eq!(marked, [5, 5 | FILLED, 5 | FILLED, 9, 9 | FILLED]);
        assert!(marked.iter().map(|&d| is_known(d)).eq([true, false, false, true, false]));
    }
}
