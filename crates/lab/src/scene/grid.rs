//! A signed distance function sampled on a grid, which is cheaper to look up than to evaluate.

use glam::{UVec3, Vec3};

use super::ray::BoundingBox;

/// A signed distance in metres, negative inside; a lower bound suffices.
pub type DistanceFn = fn(Vec3) -> f32;

/// Distances at the corners of cubic cells.
#[derive(Clone, Debug)]
pub struct DistanceGrid {
    bounds: BoundingBox,
    cell_m: f32,
    cells_per_m: f32,
    size: UVec3,
    /// `size.z * size.y * size.x` distances in metres, `x` fastest.
    gaps_m: Vec<f32>,
}

impl DistanceGrid {
    /// Samples `distance` over `bounds` in cells of `cell_m` metres.
    pub fn new(distance: DistanceFn, bounds: BoundingBox, cell_m: f32) -> Self {
        let size = ((bounds.high - bounds.low) / cell_m).ceil().as_uvec3().max(UVec3::ONE) + 1;
        let corner = |x: u32, y: u32, z: u32| bounds.low + cell_m * UVec3::new(x, y, z).as_vec3();
        let gaps_m = (0..size.z)
            .flat_map(|z| (0..size.y).flat_map(move |y| (0..size.x).map(move |x| (x, y, z))))
            .map(|(x, y, z)| distance(corner(x, y, z)))
            .collect();
        let high = corner(size.x - 1, size.y - 1, size.z - 1);
        Self { bounds: BoundingBox { low: bounds.low, high }, cell_m, cells_per_m: cell_m.recip(), size, gaps_m }
    }

    /// Returns the size of a cell, in metres.
    pub fn cell_m(&self) -> f32 {
        self.cell_m
    }

    /// Returns the interpolated distance at `p` in metres; the error is less than a cell. Outside, adds the distance to
    /// the grid.
    #[inline]
    pub fn distance_m(&self, p: Vec3) -> f32 {
        let inside = p.clamp(self.bounds.low, self.bounds.high);
        let q = (inside - self.bounds.low) * self.cells_per_m;
        let base = q.as_uvec3().min(self.size - 2);
        let f = q - base.as_vec3();
        let (row, slice) = (self.size.x as usize, (self.size.x * self.size.y) as usize);
        let first = base.z as usize * slice + base.y as usize * row + base.x as usize;
        let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
        let edge = |at: usize| mix(self.gaps_m[at], self.gaps_m[at + 1], f.x);
        let face = |at: usize| mix(edge(at), edge(at + row), f.y);
        let gap_m = mix(face(first), face(first + slice), f.z);
        if inside == p { gap_m } else { gap_m + (p - inside).length() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_grid_is_within_a_cell_of_the_function() {
        let ball: DistanceFn = |p| p.length() - 0.3;
        let grid = DistanceGrid::new(ball, BoundingBox::from_center(Vec3::ZERO, Vec3::splat(0.5)), 0.02);
        for k in 0..1000u32 {
            let p = 1.6 * (Vec3::new((k % 10) as f32, (k / 10 % 10) as f32, (k / 100) as f32) / 9.0 - 0.5);
            let gap_m = grid.distance_m(p);
            // Outside the box the distance to the box is added, an overestimate of at most twice that.
            let outside_m = (p - p.clamp(Vec3::splat(-0.5), Vec3::splat(0.5))).length();
            assert!(gap_m >= ball(p) - 0.02 && gap_m <= ball(p) + 0.02 + 2.0 * outside_m, "{p}: {gap_m}");
        }
    }
}
