//! Motion from one picture to a later one, and depth that moves with it: block matching from coarse to fine, apart for the
//! nearer and the farther surface of a block that shows two.
//!
//! What rests stays as it is, to the bit. What moves is laid over what is farther, and what it uncovers is as far as the
//! farther side of the gap.

mod blocks;
mod compare;
mod layers;
mod warp;

use pulp::{Arch, WithSimd};

use super::reduced::block_px;
use crate::frame::{ColorImage, DepthMap};
use blocks::{Blocks, CELL};
use compare::Pictures;
use layers::{Cell, Grid};

/// Columns and rows that something moved by, in pixels: right and down.
pub type Vector = [i32; 2];

/// Finds how a picture moved that is kept; owns the memory for it.
#[derive(Debug, Default)]
pub struct Motion {
    arch: Arch,
    /// The picture that is kept.
    rgb: Vec<u8>,
    grid: Grid,
    blocks: Blocks,
    /// Row by row; none where nothing is kept.
    cells: Vec<Cell>,
    masks: [Vec<u8>; 2],
    ranges: [Vec<f32>; 2],
    changes: Vec<f32>,
    above: Vec<warp::Above>,
}

impl Motion {
    /// Keeps a picture and its depth, which has no holes. Surfaces are another where inverse depth differs by `jump`, in 1/m.
    pub fn keep(&mut self, map: &DepthMap, color: &ColorImage, jump: f32) {
        self.grid = Grid { size: (color.width as usize, color.height as usize), cell_px: CELL * block_px(color.width) };
        self.cells.clear();
        let is_known = map.metres.first().is_some_and(|&metres| DepthMap::is_known(metres));
        if is_known && jump.is_finite() && self.grid.size.0.min(self.grid.size.1) >= 2 * self.grid.cell_px {
            self.rgb.clone_from(&color.rgb);
            self.arch.dispatch(Keep { motion: self, map, color, jump });
        }
    }

    /// Finds how what is kept, with its depth `map`, has moved in a later picture; whether anything has.
    pub fn find(&mut self, map: &DepthMap, color: &ColorImage) -> bool {
        let is_alike = (color.width as usize, color.height as usize) == self.grid.size;
        is_alike && !self.cells.is_empty() && self.arch.dispatch(Find { motion: self, map, color })
    }

    /// Moves the depth `from`, which was kept, as was found. `to` is a copy of it.
    pub fn warp(&mut self, from: &DepthMap, to: &mut DepthMap) {
        let Self { arch, cells, grid, above, .. } = self;
        arch.dispatch(warp::Warp { cells, grid, from, to, above });
    }

    /// How the surface at `metres` moved that pixel `at` shows.
    pub fn of(&self, at: usize, metres: f32) -> Vector {
        let (across, down) = self.grid.cells();
        let place = (at % self.grid.size.0 / self.grid.cell_px, at / self.grid.size.0 / self.grid.cell_px);
        let cells = [place].into_iter().chain(layers::around(place, (across, down)));
        let inverse = DepthMap::inverse_of(metres);
        let surfaces = cells.map(|(column, row)| self.cells[row * across + column].nearest(inverse));
        let off = |surface: &layers::Surface| (surface.inverse - inverse).abs();
        surfaces.min_by(|a, b| off(a).total_cmp(&off(b))).map_or([0; 2], |surface| surface.moved)
    }
}

/// Compiled once per instruction set.
struct Keep<'a> {
    motion: &'a mut Motion,
    map: &'a DepthMap,
    color: &'a ColorImage,
    jump: f32,
}

impl WithSimd for Keep<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Motion { blocks, cells, grid, ranges, .. } = self.motion;
        blocks.keep(self.color);
        layers::survey(self.map, grid, self.jump, cells, ranges);
    }
}

struct Find<'a> {
    motion: &'a mut Motion,
    map: &'a DepthMap,
    color: &'a ColorImage,
}

impl WithSimd for Find<'_> {
    type Output = bool;
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> bool {
        let Motion { rgb, grid, blocks, cells, masks, changes, .. } = self.motion;
        let mut pictures = Pictures { then: rgb, now: &self.color.rgb, map: self.map, grid: *grid, masks };
        let rests_below = pictures.compare(cells, changes);
        if cells.iter().all(|cell| cell.rests(rests_below)) {
            return false;
        }
        let across = grid.cells().0;
        blocks.find(self.color, |(column, row)| cells[row * across + column].rests(rests_below));
        pictures.refine(cells, blocks, rests_below);
        pictures.smooth(cells, rests_below);
        cells.iter().any(Cell::moves)
    }
}

#[cfg(test)]
mod tests;
