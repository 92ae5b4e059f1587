//! Motion-compensated depth.

use std::ops::Range;

use pulp::WithSimd;

use super::Vector;
use super::compare::Grid;
use super::layers::Cell;
use crate::depth::fill::find_holes;
use crate::frame::DepthMap;

/// Warps a map.
pub struct Warp<'a> {
    pub cells: &'a [Cell],
    pub grid: &'a Grid,
    pub from: &'a DepthMap,
    /// A copy of `from` on entry.
    pub to: &'a mut DepthMap,
    pub above: &'a mut Vec<Above>,
}

/// State of a column: the row after the last filled hole, the number of rows of the hole so far, and the depth above
/// it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Above {
    end: usize,
    rows: usize,
    metres: f32,
}

/// Marks disoccluded pixels.
const HOLE: f32 = f32::INFINITY;

impl WithSimd for Warp<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(mut self, _: S) {
        let Self { cells, grid, from, .. } = self;
        let (width, size) = (from.width as usize, (from.width as usize, from.height as usize));
        let place = |at: usize| (at % grid.cell_counts().0, at / grid.cell_counts().0);
        let moving = || cells.iter().enumerate().filter(|(_, cell)| cell.is_moving());
        for (at, cell) in moving() {
            let [xs, ys] = grid.cell_range(place(at), size);
            // First clear all moving surfaces; the second pass writes them at their new places.
            let [near, far] = [cell.near.vector, cell.far_vector()].map(|moved| moved != [0; 2]);
            for y in ys {
                for metres in &mut self.to.metres[y * width..][xs.clone()] {
                    let is_near = *metres < cell.split_m;
                    *metres = if (is_near & near) | (!is_near & far) { HOLE } else { *metres };
                }
            }
        }
        for (at, cell) in moving() {
            let cell_range = grid.cell_range(place(at), size);
            let [near, far] = [cell.near.vector, cell.far_vector()];
            if near == far {
                move_surface(from, self.to, cell_range, self.scale_to_map(near), |_| true);
                continue;
            }
            if near != [0; 2] {
                move_surface(from, self.to, cell_range.clone(), self.scale_to_map(near), |metres| {
                    metres < cell.split_m
                });
            }
            if far != [0; 2] {
                move_surface(from, self.to, cell_range, self.scale_to_map(far), |metres| metres >= cell.split_m);
            }
        }
        self.fill_holes();
    }
}

impl Warp<'_> {
    /// Scales a vector to pixels of the map.
    fn scale_to_map(&self, [x, y]: Vector) -> Vector {
        let (width, height) = self.grid.size;
        let on_map = |px: i32, of: u32, count: usize| (px as f32 * of as f32 / count as f32).round() as i32;
        [on_map(x, self.from.width, width), on_map(y, self.from.height, height)]
    }

    /// Fills holes with the farther depth on both sides, across the narrower direction.
    #[inline(always)]
    fn fill_holes(&mut self) {
        let (width, height) = (self.to.width as usize, self.to.height as usize);
        self.above.clear();
        self.above.resize(width, Above::default());
        let farther = |a: f32, b: f32| if b != HOLE && b > a { b } else { a };
        for y in 0..height {
            let (before, rest) = self.to.metres.split_at_mut(y * width);
            let (row, below) = rest.split_at_mut(width);
            let mut filled_until = 0;
            loop {
                let next = find_holes(&row[filled_until..]).next();
                let Some(hole) = next else { break };
                let hole = filled_until + hole.start..filled_until + hole.end;
                let left_m = hole.start.checked_sub(1).map_or(0.0, |x| row[x]);
                let right_m = row.get(hole.end).copied().unwrap_or(0.0);
                let beside_m = farther(left_m, right_m);
                for x in hole.clone() {
                    let above = match self.above[x] {
                        above if y > 0 && above.end == y => above,
                        _ => {
                            Above { metres: if y > 0 { before[(y - 1) * width + x] } else { 0.0 }, ..Above::default() }
                        }
                    };
                    let under = below.chunks_exact(width).take(hole.len()).position(|row| row[x] != HOLE);
                    let under_m = under.map_or(0.0, |rows| below[rows * width + x]);
                    let is_lower = above.rows + under.unwrap_or(height - y) < hole.len();
                    let across_m = farther(above.metres, under_m);
                    row[x] = if is_lower && across_m > 0.0 || beside_m <= 0.0 { across_m } else { beside_m };
                    self.above[x] = Above { end: y + 1, rows: above.rows + 1, ..above };
                }
                filled_until = hole.end;
            }
        }
    }
}

/// Copies the depth of a cell's surface, selected by `belongs_to_surface`, to its new place, if it is nearer than the
/// depth there. At the picture's border, the edge pixels are replicated.
#[inline(always)]
fn move_surface(
    from: &DepthMap,
    to: &mut DepthMap,
    [xs, ys]: [Range<usize>; 2],
    [right, down]: Vector,
    belongs_to_surface: impl Fn(f32) -> bool,
) {
    let (width, height) = (from.width as usize, from.height as usize);
    let target_range = |px: &Range<usize>, by: i32, count: usize| {
        let begins = if px.start == 0 { 0 } else { (px.start as i32 + by).clamp(0, count as i32) };
        let ends = if px.end == count { count as i32 } else { (px.end as i32 + by).clamp(0, count as i32) };
        begins as usize..ends.max(begins) as usize
    };
    let (columns, rows) = (target_range(&xs, right, width), target_range(&ys, down, height));
    // Between the replicated columns, it is a plain copy.
    let inner = |px: usize| ((px as i32 + right).max(0) as usize).clamp(columns.start, columns.end);
    let (copy_begins, copy_ends) = (inner(xs.start), inner(xs.end));
    for y in rows {
        let line = (y as i32 - down).clamp(ys.start as i32, ys.end as i32 - 1) as usize;
        let source = &from.metres[line * width..][..width];
        let target = &mut to.metres[y * width..][..width];
        let write_if_nearer = |target: &mut f32, metres: f32| {
            let is_nearer = belongs_to_surface(metres) & (metres < *target);
            *target = if is_nearer { metres } else { *target };
        };
        target[columns.start..copy_begins].iter_mut().for_each(|target| write_if_nearer(target, source[xs.start]));
        if copy_begins < copy_ends {
            let moved = &source[(copy_begins as i32 - right) as usize..];
            target[copy_begins..copy_ends]
                .iter_mut()
                .zip(moved)
                .for_each(|(target, &metres)| write_if_nearer(target, metres));
        }
        target[copy_ends..columns.end].iter_mut().for_each(|target| write_if_nearer(target, source[xs.end - 1]));
    }
}
