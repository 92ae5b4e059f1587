//! Hole filling: unknown depth, taken from the background beside it.
//!
//! A hole beside a person is a depth shadow: the wall that one of the sensor's two eyes could not see. A hole inside
//! the person is the person. Both come out right when a hole takes the farthest of the nearest known depths to its
//! left, right, above and below. The empty frame around a registered depth picture is continued the same way.

use std::ops::Range;
use std::{iter, mem};

use super::guided_fill::GuidedHoleFill;
use crate::frame::{ColorImage, DepthMap};

/// Fills depth maps; owns the memory for it, and the last map that had any depth.
#[derive(Debug, Default)]
pub struct Filler {
    /// The map being made, exchanged with the caller's when it is done.
    filled: Vec<f32>,
    /// Nearest known depth above, then below, per column.
    column_m: Vec<f32>,
    last_good: DepthMap,
    /// Which pixels were unknown before filling.
    hole: Vec<bool>,
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
        if !map.metres.iter().any(|&z_m| DepthMap::is_known(z_m)) {
            if self.last_good.size() == map.size() {
                map.metres.copy_from_slice(&self.last_good.metres);
            } else {
                map.metres.fill(0.0);
            }
            return;
        }
        // After the first pass every row and column that had a known depth is full. What is left crosses such a row, so
        // that one more pass fills it.
        if !self.fill_pass(map) {
            self.fill_pass(map);
        }
        self.last_good.resize(map.width, map.height);
        self.last_good.metres.copy_from_slice(&map.metres);
    }

    /// As [`Filler::fill`], then corrected by `color`, the picture of the map: a filled pixel that took the
    /// background's depth but looks like the near object beside it takes the object's depth.
    pub fn fill_guided(&mut self, map: &mut DepthMap, color: &ColorImage) {
        self.hole.clear();
        self.hole.extend(map.metres.iter().map(|&z_m| !DepthMap::is_known(z_m)));
        // Without a hole there is nothing to correct, and without a known depth no object to compare with.
        let is_mixed = self.hole.iter().any(|&hole| hole) && self.hole.iter().any(|&hole| !hole);
        self.fill(map);
        if is_mixed {
            self.guided.claim(map, &mut self.hole, color);
            self.last_good.metres.copy_from_slice(&map.metres);
        }
    }

    /// Gives each hole the farthest of the nearest known depths above, below, left and right. Returns whether the map
    /// is full now: a pixel whose row and column hold no known depth stays unknown.
    fn fill_pass(&mut self, map: &mut DepthMap) -> bool {
        let width = map.width as usize;
        self.filled.resize(map.metres.len(), 0.0);
        self.column_m.resize(width, 0.0);

        // Down: known depths, and in the holes the one above; then in the holes the farther one of that and left.
        self.column_m.fill(0.0);
        for (row, filled) in map.metres.chunks_exact(width).zip(self.filled.chunks_exact_mut(width)) {
            for ((&z_m, filled), above_m) in row.iter().zip(&mut *filled).zip(&mut self.column_m) {
                *filled = if DepthMap::is_known(z_m) { z_m } else { *above_m };
                *above_m = *filled;
            }
            for hole in holes(row) {
                let left_m = hole.start.checked_sub(1).map_or(0.0, |x| row[x]);
                let right_m = row.get(hole.end).copied().unwrap_or(0.0);
                let beside_m = left_m.max(right_m);
                filled[hole].iter_mut().for_each(|filled| *filled = filled.max(beside_m));
            }
        }
        // Up: in the holes, the farther one of that and below.
        let mut unfilled = 0;
        self.column_m.fill(0.0);
        for (row, filled) in map.metres.chunks_exact(width).zip(self.filled.chunks_exact_mut(width)).rev() {
            for ((&z_m, filled), below_m) in row.iter().zip(filled).zip(&mut self.column_m) {
                let known = DepthMap::is_known(z_m);
                *below_m = if known { z_m } else { *below_m };
                let far_m = if *below_m > *filled { *below_m } else { *filled };
                *filled = if known { z_m } else { far_m };
                unfilled += u32::from(*filled <= 0.0);
            }
        }
        mem::swap(&mut map.metres, &mut self.filled);
        unfilled == 0
    }
}

/// Known pixels are skipped in blocks of this size, whose test is vector code.
const SKIP_BLOCK: usize = 16;

/// The column ranges of the runs of unknown depths in a row.
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
