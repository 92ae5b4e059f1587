//! Motion estimation between two pictures, and motion-compensated depth: hierarchical block matching, separately for
//! the near and the far surface of blocks that show two.
//!
//! Depth at rest stays bit-identical. Moved depth occludes farther depth; disoccluded pixels take the depth of the
//! farther side of the gap.

mod blocks;
mod compare;
mod layers;
mod warp;

use pulp::{Arch, WithSimd};

use super::reduced::block_px;
use crate::frame::{ColorImage, DepthMap};
use blocks::{BlockMatcher, CELL};
use compare::{Grid, Pictures};
use layers::Cell;

/// One cell of this number may have changed in a way that no motion explains, as where a near surface uncovers a far one.
const MAX_UNEXPLAINED: usize = 16;

/// A displacement in pixels: right, down.
pub type Vector = [i32; 2];

/// What has become of the reference picture in a later one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Nothing moved.
    Rest,
    /// Parts of it have moved.
    Moved,
    /// Too much of it has changed in a way that no motion explains: something left or came, or another scene is shown.
    Unexplained,
}

/// Estimates the motion of a reference picture; owns the memory for it.
#[derive(Debug, Default)]
pub struct MotionEstimator {
    arch: Arch,
    /// The reference picture.
    rgb: Vec<u8>,
    grid: Grid,
    blocks: BlockMatcher,
    /// Row by row; empty if there is no reference.
    cells: Vec<Cell>,
    masks: [Vec<u8>; 2],
    ranges: [Vec<f32>; 2],
    changes: Vec<f32>,
    above: Vec<warp::Above>,
}

impl MotionEstimator {
    /// Sets the reference picture and its depth map, which has no holes. A step of inverse depth above `depth_step`, in
    /// 1/m, separates surfaces.
    pub fn set_reference(&mut self, map: &DepthMap, color: &ColorImage, depth_step: f32) {
        self.grid = Grid { size: (color.width as usize, color.height as usize), cell_px: CELL * block_px(color.width) };
        self.cells.clear();
        let is_known = map.metres.first().is_some_and(|&metres| DepthMap::is_known(metres));
        if is_known && depth_step.is_finite() && self.grid.size.0.min(self.grid.size.1) >= 2 * self.grid.cell_px {
            self.rgb.clone_from(&color.rgb);
            self.arch.dispatch(SetReference { motion: self, map, color, depth_step });
        }
    }

    /// Estimates the motion from the reference picture, with its depth `map`, to a later one.
    pub fn estimate(&mut self, map: &DepthMap, color: &ColorImage) -> Motion {
        if (color.width as usize, color.height as usize) != self.grid.size || self.cells.is_empty() {
            return Motion::Rest;
        }
        self.arch.dispatch(EstimateMotion { motion: self, map, color })
    }

    /// Warps the depth `from` of the reference picture by the estimated motion into `to`, which is a copy of it on
    /// entry.
    pub fn warp(&mut self, from: &DepthMap, to: &mut DepthMap) {
        let Self { arch, cells, grid, above, .. } = self;
        arch.dispatch(warp::Warp { cells, grid, from, to, above });
    }

    /// Returns the motion of the surface at `metres` in pixel `at`.
    pub fn vector_at(&self, at: usize, metres: f32) -> Vector {
        let (across, down) = self.grid.cell_counts();
        let place = (at % self.grid.size.0 / self.grid.cell_px, at / self.grid.size.0 / self.grid.cell_px);
        let cells = [place].into_iter().chain(layers::neighbours(place, (across, down)));
        let inverse = DepthMap::inverse_depth(metres);
        let surfaces = cells.map(|(column, row)| self.cells[row * across + column].closest_surface(inverse));
        let off = |surface: &layers::Surface| (surface.inverse - inverse).abs();
        surfaces.min_by(|a, b| off(a).total_cmp(&off(b))).map_or([0; 2], |surface| surface.vector)
    }
}

/// Compiled once per instruction set.
struct SetReference<'a> {
    motion: &'a mut MotionEstimator,
    map: &'a DepthMap,
    color: &'a ColorImage,
    depth_step: f32,
}

impl WithSimd for SetReference<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let MotionEstimator { blocks, cells, grid, ranges, .. } = self.motion;
        blocks.set_reference(self.color);
        layers::find_surfaces(self.map, grid, self.depth_step, cells, ranges);
    }
}

struct EstimateMotion<'a> {
    motion: &'a mut MotionEstimator,
    map: &'a DepthMap,
    color: &'a ColorImage,
}

impl WithSimd for EstimateMotion<'_> {
    type Output = Motion;
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> Motion {
        let MotionEstimator { rgb, grid, blocks, cells, masks, changes, .. } = self.motion;
        let mut pictures = Pictures { then: rgb, now: &self.color.rgb, map: self.map, grid: *grid, masks };
        let rest_threshold = pictures.compare_at_rest(cells, changes);
        if cells.iter().all(|cell| cell.is_at_rest(rest_threshold)) {
            return Motion::Rest;
        }
        let across = grid.cell_counts().0;
        blocks.match_blocks(self.color, |(column, row)| cells[row * across + column].is_at_rest(rest_threshold));
        pictures.refine_vectors(cells, blocks, rest_threshold);
        pictures.smooth_vectors(cells, rest_threshold);
        match cells.iter().any(Cell::is_moving) {
            _ if MAX_UNEXPLAINED * cells.iter().filter(|cell| !cell.is_explained()).count() > cells.len() => {
                Motion::Unexplained
            }
            true => Motion::Moved,
            false => Motion::Rest,
        }
    }
}

#[cfg(test)]
mod tests;
