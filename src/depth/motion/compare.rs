//! Pictures that are compared, cell by cell.

use std::ops::Range;

use crate::depth::tap::nearest;
use crate::frame::DepthMap;

use super::Vector;
use super::layers::{Cell, Grid};

/// Pixels beyond a plain nearer surface that are compared with it: what shows that it moved is its outline.
const BEYOND_PX: usize = 2;
/// Surfaces of which a cell shows fewer pixels, of those that are compared, say nothing.
const LEAST: u32 = 20;
/// Rows of a cell that are compared.
const ROWS: usize = 8;

/// Two pictures, and the depth of the first.
pub struct Pictures<'a> {
    pub then: &'a [u8],
    pub now: &'a [u8],
    pub map: &'a DepthMap,
    pub grid: Grid,
    /// Of a cell that is looked at, which bytes belong to the nearer surface, and which do not.
    pub masks: &'a mut [Vec<u8>; 2],
}

impl Pictures<'_> {
    /// Column and row of a cell.
    pub fn place(&self, at: usize) -> (usize, usize) {
        let across = self.grid.cells().0;
        (at % across, at / across)
    }

    /// Marks what belongs to the nearer surface of a cell.
    #[inline(always)]
    pub fn mask(&mut self, place: (usize, usize), &Cell { split_m, is_plain, .. }: &Cell) {
        let beyond_px = if is_plain { BEYOND_PX } else { 0 };
        let (width, height) = self.grid.size;
        let [columns, rows] = self.grid.part(place, self.grid.size);
        let (map, map_size) = (self.map, (self.map.width as usize, self.map.height as usize));
        let [near, far] = &mut *self.masks;
        near.clear();
        for y in rows.step_by(self.grid.cell_px / ROWS.min(self.grid.cell_px)) {
            let from = near.len();
            near.resize(from + 3 * columns.len(), 0);
            let row = near[from..].as_chunks_mut::<3>().0;
            let reach = |at: usize, count: usize| [at.saturating_sub(beyond_px), at, (at + beyond_px).min(count - 1)];
            for y in reach(y, height) {
                if map_size == self.grid.size {
                    let line = &map.metres[y * width..][..width];
                    row.iter_mut()
                        .zip(&line[columns.clone()])
                        .for_each(|(near, metres)| *near = [near[0] | if *metres < split_m { 0xff } else { 0 }; 3]);
                } else {
                    for (near, x) in row.iter_mut().zip(columns.clone()) {
                        let metres = map.metres[nearest(y * width + x, self.grid.size, map_size)];
                        *near = [near[0] | if metres < split_m { 0xff } else { 0 }; 3];
                    }
                }
            }
            if is_plain {
                // Along the row, too.
                spread(row.iter_mut(), 1);
                spread(row.iter_mut().rev(), 2);
                row.iter_mut().for_each(|near| *near = [near[1] | near[2]; 3]);
            }
        }
        far.clear();
        far.extend(near.iter().map(|near| !near));
    }

    /// The mean difference of a cell that moved so far, or of its nearer or farther surface, which are then marked. Of what is
    /// outside of the picture nothing is known: `None` where that is most of it, or it shows too little.
    #[inline(always)]
    pub fn off(&self, place: (usize, usize), [right, down]: Vector, is_near: Option<bool>) -> Option<f32> {
        let (width, height) = self.grid.size;
        let [columns, rows] = self.grid.part(place, self.grid.size);
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
            match mask {
                None => {
                    sum += difference(then, now);
                    count += then.len() as u32;
                }
                Some(mask) => {
                    let mask = &mask[3 * (line * columns.len() + xs.start - columns.start)..][..then.len()];
                    let (difference, marked) = marked_difference((then, now), mask);
                    (sum, count) = (sum + difference, count + marked);
                }
            }
        }
        (count >= 3 * LEAST).then(|| sum as f32 / count as f32)
    }
}

/// Marks by its byte `to` what is marked by its first one, and as many pixels after.
fn spread<'a>(row: impl Iterator<Item = &'a mut [u8; 3]>, to: usize) {
    row.fold(0, |left_px: usize, near| {
        let left_px = if near[0] != 0 { BEYOND_PX + 1 } else { left_px };
        near[to] = if left_px > 0 { 0xff } else { 0 };
        left_px.saturating_sub(1)
    });
}

/// Bytes that are compared at once: a row of a cell has some of these.
const AT_ONCE: usize = 16;

/// The sum of absolute differences.
#[inline(always)]
fn difference(then: &[u8], now: &[u8]) -> u32 {
    let sum = |then: &[u8], now: &[u8]| then.iter().zip(now).map(|(a, b)| u32::from(a.abs_diff(*b))).sum::<u32>();
    let ((then, then_rest), (now, now_rest)) = (then.as_chunks::<AT_ONCE>(), now.as_chunks::<AT_ONCE>());
    let rest = sum(then_rest, now_rest);
    then.iter().zip(now).fold(rest, |total, (then, now)| total + sum(then, now))
}

/// The same of the bytes that are marked, and how many these are.
#[inline(always)]
fn marked_difference((then, now): (&[u8], &[u8]), mask: &[u8]) -> (u32, u32) {
    let sum = |then: &[u8], now: &[u8], mask: &[u8]| {
        let pairs = then.iter().zip(now).zip(mask);
        let difference: u32 = pairs.map(|((a, b), m)| u32::from((a & m).abs_diff(b & m))).sum();
        (difference, mask.iter().map(|m| u32::from(m & 1)).sum::<u32>())
    };
    let ((then, then_rest), (now, now_rest)) = (then.as_chunks::<AT_ONCE>(), now.as_chunks::<AT_ONCE>());
    let (mask, mask_rest) = mask.as_chunks::<AT_ONCE>();
    let rest = sum(then_rest, now_rest, mask_rest);
    then.iter().zip(now).zip(mask).fold(rest, |(total, count), ((then, now), mask)| {
        let (difference, marked) = sum(then, now, mask);
        (total + difference, count + marked)
    })
}
