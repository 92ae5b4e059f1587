//! Tracks the tiles of a picture near edges: only those are aligned.

use std::ops::Range;

use crate::compute::bands::Bands;

/// Columns and rows of a tile: how far edges move in all rounds but the last, plus the radius of the band and of a
/// window. Larger tiles would be copied to the planes in vain.
const COLUMNS: usize = 20;
pub const ROWS: usize = 20;

/// The tiles of a picture that have an edge, and their neighbours.
#[derive(Debug, Default)]
pub struct Tiles {
    width: usize,
    across: usize,
    has_edge: Vec<bool>,
    is_near: Vec<bool>,
}

impl Tiles {
    /// Resets to a picture of this size without edges.
    pub fn clear(&mut self, width: usize, height: usize) {
        let down = height.div_ceil(ROWS);
        (self.width, self.across) = (width, width.div_ceil(COLUMNS));
        for tiles in [&mut self.has_edge, &mut self.is_near] {
            tiles.clear();
            tiles.resize(self.across * down, false);
        }
    }

    /// Splits the tiles into bands of whole tiles, for [`mark_edge_tiles`].
    pub fn split(&mut self, bands: Bands) -> impl Iterator<Item = &mut [bool]> {
        bands.split_tiles(&mut self.has_edge, ROWS, self.across)
    }

    /// Finds the tiles that have edges, and their neighbours.
    pub fn mark_neighbours(&mut self) {
        let down = self.has_edge.len() / self.across;
        for k in (0..self.has_edge.len()).filter(|&k| self.has_edge[k]) {
            let (row, column) = (k / self.across, k % self.across);
            for row in row.saturating_sub(1)..(row + 2).min(down) {
                let tiles = &mut self.is_near[row * self.across..][..self.across];
                tiles[column.saturating_sub(1)..(column + 2).min(self.across)].fill(true);
            }
        }
    }

    /// Appends the pixel indices of all edges, in order.
    pub fn collect_edges(&self, edge: &[bool], places: &mut Vec<u32>) {
        for (y, row) in edge.chunks_exact(self.width).enumerate() {
            let tiles = &self.has_edge[y / ROWS * self.across..][..self.across];
            for (k, _) in tiles.iter().enumerate().filter(|(_, has_edge)| **has_edge) {
                let columns = k * COLUMNS..((k + 1) * COLUMNS).min(self.width);
                let first = (y * self.width + columns.start) as u32;
                places.extend((first..).zip(&row[columns]).filter(|(_, edge)| **edge).map(|(place, _)| place));
            }
        }
    }

    /// Returns the column ranges of row `y` near edges, from the left; each begins at an even column.
    pub fn near_columns(&self, y: usize) -> impl Iterator<Item = Range<usize>> + use<'_> {
        let tiles = &self.is_near[y / ROWS * self.across..][..self.across];
        let runs = tiles.chunk_by(|a, b| a == b).scan(0, |begin, run| {
            let first = *begin;
            *begin += run.len();
            Some((run[0], first * COLUMNS..(*begin * COLUMNS).min(self.width)))
        });
        runs.filter_map(|(is_near, columns)| is_near.then_some(columns))
    }
}

/// Marks the tiles of a band that have edges.
#[inline(always)]
pub fn mark_edge_tiles(has_edge: &mut [bool], edge: &[bool], width: usize) {
    let across = width.div_ceil(COLUMNS);
    for (y, row) in edge.chunks_exact(width).enumerate() {
        let tiles = &mut has_edge[y / ROWS * across..][..across];
        for (has_edge, columns) in tiles.iter_mut().zip(row.chunks(COLUMNS)) {
            *has_edge |= columns.iter().fold(false, |any, edge| any | edge);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_around_an_edge_is_near_it_and_nothing_is_far_from_it() {
        let (width, height) = (7 * COLUMNS + 5, 5 * ROWS + 1);
        for (x, y) in [(0, 0), (width - 1, height - 1), (3 * COLUMNS, 2 * ROWS), (4 * COLUMNS - 1, 3 * ROWS - 1)] {
            let mut edge = vec![false; width * height];
            edge[y * width + x] = true;
            let mut tiles = Tiles::default();
            tiles.clear(width, height);
            mark_edge_tiles(&mut tiles.has_edge, &edge, width);
            tiles.mark_neighbours();
            for row in 0..height {
                let mut is_near = vec![false; width];
                for columns in tiles.near_columns(row) {
                    assert!(columns.start.is_multiple_of(2));
                    is_near[columns].fill(true);
                }
                for (column, is_near) in is_near.into_iter().enumerate() {
                    let (right, down) = (column.abs_diff(x), row.abs_diff(y));
                    assert!(is_near || right > COLUMNS || down > ROWS, "{column},{row} for {x},{y}");
                    assert!(!is_near || right < 2 * COLUMNS && down < 2 * ROWS, "{column},{row} for {x},{y}");
                }
            }
        }
    }
}
