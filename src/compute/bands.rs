//! Bands of rows: splits a picture among the threads of a pool.

use std::ops::Range;

use super::thread_pool::{MAX_ITEMS, ThreadPool};

/// Bands per thread: if one thread is delayed, the others take over its bands.
const BANDS_PER_THREAD: usize = 4;
/// Smallest number of rows of a band: smaller bands would read too many rows of their neighbours.
const MIN_ROWS: usize = 40;

/// Partition of a picture into bands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bands {
    height: usize,
    /// Rows of a band; the last may have fewer.
    rows: usize,
}

impl Bands {
    /// Splits `height` rows for these threads, a multiple of `row_multiple` rows in each band; one band for one thread.
    pub fn new(height: usize, row_multiple: usize, workers: &ThreadPool) -> Self {
        let threads = workers.thread_count();
        let max_bands = if threads > 1 { (BANDS_PER_THREAD * threads).min(MAX_ITEMS) } else { 1 };
        let rows = height.div_ceil(max_bands).max(MIN_ROWS).next_multiple_of(row_multiple);
        Self { height, rows }
    }

    /// Returns the rows of each band.
    pub fn rows(self) -> impl Iterator<Item = Range<usize>> + Clone {
        (0..self.height).step_by(self.rows).map(move |first| first..(first + self.rows).min(self.height))
    }

    /// Splits a plane with `row_len` values per row into bands.
    pub fn split<T>(self, plane: &mut [T], row_len: usize) -> impl Iterator<Item = &mut [T]> {
        plane.chunks_mut((self.rows * row_len).max(1))
    }

    /// Splits tiles into bands; tiles are `side` rows high, `tiles_per_row` per row of tiles, and `side` divides the
    /// unit.
    pub fn split_tiles<T>(self, tiles: &mut [T], side: usize, tiles_per_row: usize) -> impl Iterator<Item = &mut [T]> {
        tiles.chunks_mut((self.rows / side * tiles_per_row).max(1))
    }
}

/// Returns the number of values per item of a pass over `count` values: at least `min_len`, to be worth a thread.
pub fn chunk_len(count: usize, min_len: usize) -> usize {
    count.div_ceil(MAX_ITEMS).max(min_len)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_are_all_rows_in_order_and_no_more_than_a_pass_takes() {
        for threads in [1, 2, 3, 16] {
            let workers = ThreadPool::new("test", threads);
            for (height, row_multiple) in [(0, 1), (1, 1), (7, 20), (720, 20), (721, 8), (4320, 1)] {
                let bands = Bands::new(height, row_multiple, &workers);
                let mut plane: Vec<usize> = (0..3 * height).map(|at| at / 3).collect();
                let (mut next, mut count) = (0, 0);
                for (rows, values) in bands.rows().zip(bands.split(&mut plane, 3)) {
                    assert_eq!((rows.start, values.len()), (next, 3 * rows.len()));
                    assert!(rows.start.is_multiple_of(row_multiple) && values[0] == rows.start);
                    (next, count) = (rows.end, count + 1);
                }
                assert!(next == height && count <= MAX_ITEMS && (threads > 1 || count <= 1));
            }
        }
    }
}
