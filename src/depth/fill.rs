//! Hole filling: unknown depth is filled from the background.
//!
//! A hole beside a person is an occlusion shadow: the wall that one of the sensor's two cameras cannot see. A hole
//! inside the person is the person. Both are correct if a hole takes the farthest of the nearest known depths to its
//! left, right, above and below. The empty frame around a registered depth picture is filled the same way.
//!
//! Holes are found once, as runs of pixels along rows; later steps access only their pixels and the adjacent ones.
//!
//! twin: shaders/refine/beside.wgsl, shaders/refine/fill.wgsl

use std::ops::Range;
use std::{iter, mem};

use pulp::{Arch, WithSimd};

use super::guided_fill::{GuidedHoleFill, Run};
use crate::frame::{ColorImage, DepthMap};

/// Fills depth maps; owns its buffers.
#[derive(Debug, Default)]
pub struct HoleFiller {
    arch: Arch,
    /// The holes, row by row, the rest of them after a pass, and the filled depths of a pass.
    holes: Vec<Run>,
    left: Vec<Run>,
    filled_m: Vec<f32>,
    /// Nearest known depth above, then below, per column.
    column_m: Vec<f32>,
    guided: GuidedHoleFill,
}

impl HoleFiller {
    /// Creates a filler.
    pub fn new() -> Self {
        Self::default()
    }

    /// Fills every unknown depth of `map`, in time linear in its pixels. A map without any known depth stays unknown (0)
    /// everywhere.
    pub fn fill(&mut self, map: &mut DepthMap) {
        self.fill_from_background(map);
    }

    /// Fills like [`HoleFiller::fill`], then corrects by `color`, the picture of the map: a pixel filled from the
    /// background takes the depth of the near object beside it if it has that object's colour.
    pub fn fill_guided(&mut self, map: &mut DepthMap, color: &ColorImage) {
        if self.fill_from_background(map) {
            self.guided.assign_to_foreground(map, &self.holes, color);
        }
    }

    /// Returns the unknown runs of the last map, row by row.
    pub(super) fn holes(&self) -> &[Run] {
        &self.holes
    }

    /// Fills the holes; returns whether any depth was known.
    fn fill_from_background(&mut self, map: &mut DepthMap) -> bool {
        let Self { arch, holes, left, filled_m, column_m, .. } = self;
        holes.clear();
        arch.dispatch(FindHoleRuns { map, holes });
        if holes.iter().map(|hole| hole.range().len()).sum::<usize>() == map.metres.len() {
            map.metres.fill(0.0);
            return false;
        }
        let is_full = arch.dispatch(FillPass { map, holes, filled_m, column_m });
        // Every row and column that had a known depth is full now. The remaining holes cross such a row, so that one
        // more pass fills them.
        if !is_full {
            let width = map.width as usize;
            left.clear();
            for &hole in &*holes {
                left.extend(self::find_holes(&map.metres[hole.pixels(width)]).map(|of_hole| Run {
                    start: hole.start + of_hole.start as u32,
                    end: hole.start + of_hole.end as u32,
                    ..hole
                }));
            }
            arch.dispatch(FillPass { map, holes: left, filled_m, column_m });
        }
        true
    }
}

/// Finds the holes of a map, row by row.
struct FindHoleRuns<'a> {
    map: &'a DepthMap,
    holes: &'a mut Vec<Run>,
}

impl WithSimd for FindHoleRuns<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { map, holes } = self;
        for (line, row) in map.metres.chunks_exact((map.width as usize).max(1)).enumerate() {
            let run = |Range { start, end }| Run { line: line as u32, start: start as u32, end: end as u32 };
            holes.extend(self::find_holes(row).map(run));
        }
    }
}

/// Fills each of the `holes`, which are all unknown pixels of a map, with the farthest of the nearest known depths
/// above, below, left and right. Returns whether the map is full: a pixel whose row and column have no known depth
/// stays unknown.
struct FillPass<'a> {
    map: &'a mut DepthMap,
    holes: &'a [Run],
    filled_m: &'a mut Vec<f32>,
    column_m: &'a mut Vec<f32>,
}

impl WithSimd for FillPass<'_> {
    type Output = bool;
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> bool {
        let Self { map, holes, filled_m, column_m } = self;
        let (width, height) = (map.width as usize, map.height as usize);
        let row = |y: usize| &map.metres[y * width..][..width];
        filled_m.clear();
        // Downwards: the farthest of above, left and right. The nearest depth above a hole is directly above it, or the
        // nearest one above the hole that is there.
        column_m.clear();
        column_m.resize(width, 0.0);
        for hole in holes {
            let (y, columns) = (hole.line as usize, hole.range());
            let above_m = &mut column_m[columns.clone()];
            if y > 0 {
                update_known(above_m, &row(y - 1)[columns.clone()]);
            }
            let left_m = columns.start.checked_sub(1).map_or(0.0, |x| row(y)[x]);
            let right_m = row(y).get(columns.end).copied().unwrap_or(0.0);
            let beside_m = left_m.max(right_m);
            filled_m.extend(above_m.iter().map(|&above_m| farther(above_m, beside_m)));
        }
        // Upwards: the farther one of that and below.
        column_m.fill(0.0);
        let mut is_full = true;
        let (mut end, mut rest) = (filled_m.len(), &mut filled_m[..]);
        for hole in holes.iter().rev() {
            let (y, columns) = (hole.line as usize, hole.range());
            let below_m = &mut column_m[columns.clone()];
            if y + 1 < height {
                update_known(below_m, &row(y + 1)[columns.clone()]);
            }
            let (before, filled_m) = mem::take(&mut rest).split_at_mut(end - columns.len());
            (rest, end) = (before, end - columns.len());
            for (filled_m, &below_m) in filled_m.iter_mut().zip(&*below_m) {
                *filled_m = farther(*filled_m, below_m);
                is_full &= *filled_m > 0.0;
            }
        }
        let mut filled_m = &filled_m[..];
        for hole in holes {
            let row = &mut map.metres[hole.pixels(width)];
            row.copy_from_slice(&filled_m[..row.len()]);
            filled_m = &filled_m[row.len()..];
        }
        is_full
    }
}

/// Replaces depths by the known ones of a row.
#[inline(always)]
fn update_known(column_m: &mut [f32], row: &[f32]) {
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

/// Returns the column ranges of the runs of unknown depths in a row.
#[inline(always)]
pub(super) fn find_holes(row: &[f32]) -> impl Iterator<Item = Range<usize>> {
    let mut next = 0;
    iter::from_fn(move || {
        // Most pixels are known. `&` instead of an early exit, so that the test of a block becomes vector code.
        let all_known = |block: &[f32]| block.iter().fold(true, |all, &z_m| all & DepthMap::is_known(z_m));
        next += SKIP_BLOCK * row[next..].chunks_exact(SKIP_BLOCK).take_while(|block| all_known(block)).count();
        let start = next + row[next..].iter().position(|&z_m| !DepthMap::is_known(z_m))?;
        next = start + row[start..].iter().position(|&z_m| DepthMap::is_known(z_m)).unwrap_or(row.len() - start);
        Some(start..next)
    })
}
