//! Hole filling: unknown depth, taken from the background beside it.
//!
//! A hole beside a person is a depth shadow: the wall that one of the sensor's two eyes could not see. A hole inside
//! the person is the person. Both come out right when a hole takes the farthest of the nearest known depths to its
//! left, right, above and below. The empty frame around a registered depth picture is continued the same way.

use std::ops::Range;
use std::{iter, mem};

use pulp::{Arch, WithSimd};

use super::guided_fill::{GuidedHoleFill, Run};
use crate::frame::{ColorImage, DepthMap};

/// Fills depth maps; owns the memory for it, and the last map that had any depth.
#[derive(Debug, Default)]
pub struct Filler {
    arch: Arch,
    /// The holes, row by row, and the depths for them.
    holes: Vec<Run>,
    filled_m: Vec<f32>,
    /// Nearest known depth above, then below, per column.
    column_m: Vec<f32>,
    last_good: DepthMap,
    guided: GuidedHoleFill,
}

impl Filler {
    /// No memory of earlier frames.
    pub fn new() -> Self {
        Self::default()
    }

    /// Fills every unknown depth of `map`, in time linear in its pixels. A map with no known depth at all becomes a
    /// copy of the last good one of the same size; if there is none it stays unknown (0) everywhere.
    pub fn fill(&mut self, map: &mut DepthMap) {
        if self.fill_all(map) {
            self.keep(map);
        }
    }

    /// As [`Filler::fill`], then corrected by `color`, the picture of the map: a filled pixel that took the
    /// background's depth but looks like the near object beside it takes the object's depth.
    pub fn fill_guided(&mut self, map: &mut DepthMap, color: &ColorImage) {
        if self.fill_all(map) {
            self.guided.claim(map, &self.holes, color);
            self.keep(map);
        }
    }

    /// Fills the holes, and tells them apart; returns whether anything was known.
    fn fill_all(&mut self, map: &mut DepthMap) -> bool {
        let is_full = self.fill_pass(map);
        let hole_pixels = self.filled_m.len();
        if hole_pixels == map.metres.len() {
            if self.last_good.size() == map.size() {
                map.metres.copy_from_slice(&self.last_good.metres);
            } else {
                map.metres.fill(0.0);
            }
            return false;
        }
        // Every row and column that had a known depth is full now. What is left crosses such a row, so that one more pass
        // fills it.
        if !is_full {
            let holes = mem::take(&mut self.holes);
            self.fill_pass(map);
            self.holes = holes;
        }
        true
    }

    fn keep(&mut self, map: &DepthMap) {
        self.last_good.resize(map.width, map.height);
        self.last_good.metres.copy_from_slice(&map.metres);
    }

    /// Gives each hole the farthest of the nearest known depths above, below, left and right. Returns whether the map
    /// is full now: a pixel whose row and column hold no known depth stays unknown.
    fn fill_pass(&mut self, map: &mut DepthMap) -> bool {
        let Self { arch, holes, filled_m, column_m, .. } = self;
        arch.dispatch(FillPass { map, holes, filled_m, column_m })
    }
}

/// See [`Filler::fill_pass`].
struct FillPass<'a> {
    map: &'a mut DepthMap,
    holes: &'a mut Vec<Run>,
    filled_m: &'a mut Vec<f32>,
    column_m: &'a mut Vec<f32>,
}

impl WithSimd for FillPass<'_> {
    type Output = bool;
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> bool {
        let Self { map, holes, filled_m, column_m } = self;
        let width = map.width as usize;
        holes.clear();
        filled_m.clear();
        // Down: in the holes, the farthest one of above, left and right.
        column_m.clear();
        column_m.resize(width, 0.0);
        for (y, row) in map.metres.chunks_exact(width.max(1)).enumerate() {
            for hole in self::holes(row) {
                let left_m = hole.start.checked_sub(1).map_or(0.0, |x| row[x]);
                let right_m = row.get(hole.end).copied().unwrap_or(0.0);
                let beside_m = left_m.max(right_m);
                filled_m.extend(column_m[hole.clone()].iter().map(|&above_m| farther(above_m, beside_m)));
                holes.push(Run { line: y as u32, start: hole.start as u32, end: hole.end as u32 });
            }
            take_known(column_m, row);
        }
        // Up: the farther one of that and below.
        column_m.fill(0.0);
        let mut is_full = true;
        let (mut left, mut rest) = (&holes[..], &mut filled_m[..]);
        for (y, row) in map.metres.chunks_exact_mut(width.max(1)).enumerate().rev() {
            while let Some((hole, before)) = left.split_last().filter(|(hole, _)| hole.line as usize == y) {
                let filled_m;
                (rest, filled_m) = rest.split_at_mut(rest.len() - hole.range().len());
                left = before;
                for (filled_m, &below_m) in filled_m.iter_mut().zip(&column_m[hole.range()]) {
                    *filled_m = farther(*filled_m, below_m);
                    is_full &= *filled_m > 0.0;
                }
            }
            take_known(column_m, row);
        }
        let mut filled_m = &filled_m[..];
        for hole in &*holes {
            let row = &mut map.metres[hole.of_row(width)];
            row.copy_from_slice(&filled_m[..row.len()]);
            filled_m = &filled_m[row.len()..];
        }
        is_full
    }
}

/// Replaces depths by those of a row that are known.
#[inline(always)]
fn take_known(column_m: &mut [f32], row: &[f32]) {
    for (column_m, &z_m) in column_m.iter_mut().zip(row) {
        *column_m = if DepthMap::is_known(z_m) { z_m } else { *column_m };
    }
}

#[inline(always)]
fn farther(a_m: f32, b_m: f32) -> f32 {
    if b_m > a_m { b_m } else { a_m }
}

/// Known pixels are skipped in blocks of this size, whose test is vector code.
const SKIP_BLOCK: usize = 16;

/// The column ranges of the runs of unknown depths in a row.
#[inline(always)]
pub(super) fn holes(row: &[f32]) -> impl Iterator<Item = Range<usize>> {
    let mut next = 0;
    iter::from_fn(move || {
        // Most pixels are known. `&` instead of an early exit, so that a block becomes vector code.
        let all_known = |block: &[f32]| block.iter().fold(true, |all, &z_m| all & DepthMap::is_known(z_m));
        next += SKIP_BLOCK * row[next..].chunks_exact(SKIP_BLOCK).take_while(|block| all_known(block)).count();
        let start = next + row[next..].iter().position(|&z_m| !DepthMap::is_known(z_m))?;
        next = start + row[start..].iter().position(|&z_m| DepthMap::is_known(z_m)).unwrap_or(row.len() - start);
        Some(start..next)
    })
}
