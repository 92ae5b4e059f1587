//! Comparison of two pictures, cell by cell.

use std::ops::Range;

use crate::depth::tap::nearest_index;
use crate::frame::DepthMap;

use super::Vector;

/// Radius in pixels by which the mask of an untextured near surface is dilated: only its outline shows motion.
const DILATION_PX: usize = 2;
/// Minimum number of compared pixels of a surface in a cell; half of a cell where that is less, as in small pictures.
const MIN_PIXELS: u32 = 20;
/// Number of rows of a cell that are compared.
const ROWS: usize = 8;

/// A grid of square cells over pictures of `size`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Grid {
    pub size: (usize, usize),
    pub cell_px: usize,
}

impl Grid {
    /// Returns the numbers of columns and rows of cells.
    pub fn cell_counts(&self) -> (usize, usize) {
        (self.size.0.div_ceil(self.cell_px), self.size.1.div_ceil(self.cell_px))
    }

    /// Returns the pixel columns and rows of a cell, in a map of size `map` of the same view.
    #[inline(always)]
    pub fn cell_range(&self, (column, row): (usize, usize), map: (usize, usize)) -> [Range<usize>; 2] {
        let on_map =
            |px: usize, count: usize, of: usize| if of == count { px.min(count) } else { px.min(count) * of / count };
        let span =
            |at: usize, count, of| on_map(at * self.cell_px, count, of)..on_map((at + 1) * self.cell_px, count, of);
        [span(column, self.size.0, map.0), span(row, self.size.1, map.1)]
    }
}

/// Two pictures, and the depth of the first.
pub struct Pictures<'a> {
    pub then: &'a [u8],
    pub now: &'a [u8],
    pub map: &'a DepthMap,
    pub grid: Grid,
    /// Byte masks of the current cell: the near surface, and the rest.
    pub masks: &'a mut [Vec<u8>; 2],
}

impl Pictures<'_> {
    /// Returns column and row of a cell.
    pub fn cell_position(&self, at: usize) -> (usize, usize) {
        let across = self.grid.cell_counts().0;
        (at % across, at / across)
    }

    /// Computes the mask of a cell's near surface, which is nearer than `split_m`.
    #[inline(always)]
    pub fn compute_mask(&mut self, place: (usize, usize), split_m: f32, is_untextured: bool) {
        let beyond_px = if is_untextured { DILATION_PX } else { 0 };
        let (width, height) = self.grid.size;
        let [columns, rows] = self.grid.cell_range(place, self.grid.size);
        let (map, map_size) = (self.map, (self.map.width as usize, self.map.height as usize));
        let [near, far] = &mut *self.masks;
        near.clear();
        for y in rows.step_by(self.grid.cell_px / ROWS.min(self.grid.cell_px)) {
            let from = near.len();
            near.resize(from + 3 * columns.len(), 0);
            let row = near[from..].as_chunks_mut::<3>().0;
            let window = |at: usize, count: usize| [at.saturating_sub(beyond_px), at, (at + beyond_px).min(count - 1)];
            for y in window(y, height) {
                if map_size == self.grid.size {
                    let line = &map.metres[y * width..][..width];
                    row.iter_mut()
                        .zip(&line[columns.clone()])
                        .for_each(|(near, metres)| *near = [near[0] | if *metres < split_m { 0xff } else { 0 }; 3]);
                } else {
                    for (near, x) in row.iter_mut().zip(columns.clone()) {
                        let metres = map.metres[nearest_index(y * width + x, self.grid.size, map_size)];
                        *near = [near[0] | if metres < split_m { 0xff } else { 0 }; 3];
                    }
                }
            }
            if is_untextured {
                // Dilation along the row.
                dilate_row(row.iter_mut(), 1);
                dilate_row(row.iter_mut().rev(), 2);
                row.iter_mut().for_each(|near| *near = [near[1] | near[2]; 3]);
            }
        }
        far.clear();
        far.extend(near.iter().map(|near| !near));
    }

    /// Returns the mean absolute difference of a cell after a displacement, in codes; with `is_near`, of one surface by
    /// the masks of [`Self::compute_mask`]. Pixels outside the picture are ignored; `None` if these are the majority,
    /// or too few are left.
    #[inline(always)]
    pub fn mean_difference(&self, place: (usize, usize), [right, down]: Vector, is_near: Option<bool>) -> Option<f32> {
        let (width, height) = self.grid.size;
        let [columns, rows] = self.grid.cell_range(place, self.grid.size);
        let inside = |range: &Range<usize>, by: i32, count: usize| {
            let clamp = |px: usize| (px as i32 + by).clamp(0, count as i32) - by;
            clamp(range.start) as usize..clamp(range.end).max(0) as usize
        };
        let (xs, ys) = (inside(&columns, right, width), inside(&rows, down, height));
        if 2 * xs.len() < columns.len() || 2 * ys.len() < rows.len() {
            return None;
        }
        let mask = is_near.map(|is_near| &self.masks[usize::from(!is_near)]);
        let moved = down as isize * width as isize + right as isize;
        let (mut sum, mut count) = (0u32, 0u32);
        for (line, y) in rows.clone().step_by(self.grid.cell_px / ROWS.min(self.grid.cell_px)).enumerate() {
            if !ys.contains(&y) {
                continue;
            }
            let from = y * width + xs.start;
            let then = &self.then[3 * from..][..3 * xs.len()];
            let now = &self.now[3 * from.wrapping_add_signed(moved)..][..3 * xs.len()];
            let (difference, compared) = match mask {
                None => (sum_of_differences(then, now), then.len() as u32),
                Some(mask) => {
                    // The mask has the compared rows of the whole cell, one after the other.
                    let at = line * columns.len() + xs.start - columns.start;
                    masked_sum_of_differences(then, now, &mask[3 * at..][..then.len()])
                }
            };
            sum += difference;
            count += compared;
        }
        let min_pixels = MIN_PIXELS.min((self.grid.cell_px * self.grid.cell_px) as u32 / 2);
        (count >= 3 * min_pixels).then(|| sum as f32 / count as f32)
    }
}

/// Dilates byte 0 by [`DILATION_PX`] pixels along the iterator, into byte `to`.
fn dilate_row<'a>(row: impl Iterator<Item = &'a mut [u8; 3]>, to: usize) {
    row.fold(0, |left_px: usize, near| {
        let left_px = if near[0] != 0 { DILATION_PX + 1 } else { left_px };
        near[to] = if left_px > 0 { 0xff } else { 0 };
        left_px.saturating_sub(1)
    });
}

/// Bytes compared at once; a row of a cell has several times as many.
const CHUNK: usize = 16;

/// Returns the sum of absolute differences.
#[inline(always)]
fn sum_of_differences(then: &[u8], now: &[u8]) -> u32 {
    let sum = |then: &[u8], now: &[u8]| then.iter().zip(now).map(|(a, b)| u32::from(a.abs_diff(*b))).sum::<u32>();
    let ((then, then_rest), (now, now_rest)) = (then.as_chunks::<CHUNK>(), now.as_chunks::<CHUNK>());
    let rest = sum(then_rest, now_rest);
    then.iter().zip(now).fold(rest, |total, (then, now)| total + sum(then, now))
}

/// Returns the sum of absolute differences of the masked bytes, and their number.
#[inline(always)]
fn masked_sum_of_differences(then: &[u8], now: &[u8], mask: &[u8]) -> (u32, u32) {
    let sum = |then: &[u8], now: &[u8], mask: &[u8]| {
        let pairs = then.iter().zip(now).zip(mask);
        let difference: u32 = pairs.map(|((a, b), m)| u32::from((a & m).abs_diff(b & m))).sum();
        (difference, mask.iter().map(|m| u32::from(m & 1)).sum::<u32>())
    };
    let ((then, then_rest), (now, now_rest)) = (then.as_chunks::<CHUNK>(), now.as_chunks::<CHUNK>());
    let (mask, mask_rest) = mask.as_chunks::<CHUNK>();
    let rest = sum(then_rest, now_rest, mask_rest);
    then.iter().zip(now).zip(mask).fold(rest, |(total, count), ((then, now), mask)| {
        let (difference, marked) = sum(then, now, mask);
        (total + difference, count + marked)
    })
}
