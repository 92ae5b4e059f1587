//! Cells of a picture, with one or two surfaces each, and the motion of these.

use crate::frame::DepthMap;

use super::Vector;
use super::blocks::{BlockMatcher, CELL};
use super::compare::{Grid, Pictures};

/// A surface is at rest up to this multiple of the median change, which is mostly camera noise, within these bounds, in
/// codes.
const REST_FACTOR: f32 = 2.5;
const REST_BOUNDS: (f32, f32) = (2.5, 8.0);
/// Fraction of that threshold below which the cell as a whole is at rest.
const WHOLE_CELL_FACTOR: f32 = 0.3;
/// Maximum ratio of the difference after motion to that at rest; otherwise the motion is unknown.
const MAX_RESIDUAL_RATIO: f32 = 0.7;
/// Mean difference after motion, in codes, from which a surface shows something else.
const UNEXPLAINED_RESIDUAL: f32 = 16.0;
/// Cost of each pixel of a vector's length, in codes.
const COST_PER_PX: f32 = 0.1;
/// Maximum ratio by which a neighbour's vector may be worse to be adopted.
const ADOPTION_RATIO: f32 = 1.15;
/// Maximum relative difference of inverse depth within one surface.
const SAME_SURFACE: f32 = 0.3;
/// Steps of the vector search (diamond pattern).
const STEPS: [Vector; 4] = [[0, -1], [-1, 0], [1, 0], [0, 1]];

/// A surface in a cell.
#[derive(Clone, Copy, Debug, Default)]
pub struct Surface {
    /// Inverse depth, in 1/m.
    pub inverse: f32,
    /// Its motion vector.
    pub vector: Vector,
    is_known: bool,
    /// Mean absolute differences, in codes: at rest, and after motion. At rest 0 if too few pixels are compared.
    difference_at_rest: f32,
    residual: f32,
}

/// A cell with one or two surfaces: pixels from `split_m` on belong to the far one.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cell {
    pub near: Surface,
    pub far: Option<Surface>,
    /// Infinite if there is one surface.
    pub split_m: f32,
    /// Whether the near surface seems at rest for lack of texture, while the far one moves.
    pub is_untextured: bool,
}

impl Cell {
    pub fn surfaces(&self) -> impl Iterator<Item = Surface> {
        [Some(self.near), self.far].into_iter().flatten()
    }

    pub fn far_vector(&self) -> Vector {
        self.far.map_or(self.near.vector, |far| far.vector)
    }

    pub fn is_moving(&self) -> bool {
        self.surfaces().any(|surface| surface.vector != [0; 2])
    }

    /// Whether its surfaces look as before, once moved.
    pub fn is_explained(&self) -> bool {
        self.surfaces().all(|surface| surface.residual < UNEXPLAINED_RESIDUAL)
    }

    /// Returns the surface whose inverse depth is closest to `inverse`.
    pub fn closest_surface(&self, inverse: f32) -> Surface {
        let is_far = |far: &Surface| (far.inverse - inverse).abs() < (self.near.inverse - inverse).abs();
        self.far.filter(is_far).unwrap_or(self.near)
    }

    fn surface_mut(&mut self, is_near: bool) -> Option<&mut Surface> {
        if is_near { Some(&mut self.near) } else { self.far.as_mut() }
    }

    pub fn is_at_rest(&self, rest_threshold: f32) -> bool {
        self.surfaces().all(|surface| surface.difference_at_rest <= rest_threshold)
    }
}

/// Iterates over the up to eight neighbouring cells.
pub fn neighbours(
    (column, row): (usize, usize),
    (across, down): (usize, usize),
) -> impl Iterator<Item = (usize, usize)> {
    let range = |at: usize, count: usize| at.saturating_sub(1)..(at + 2).min(count);
    let cells = range(row, down).flat_map(move |y| range(column, across).map(move |x| (x, y)));
    cells.filter(move |&cell| cell != (column, row))
}

/// Finds the surfaces of all cells: two if inverse depths differ by more than `depth_step`, in 1/m. `ranges` is scratch
/// memory.
#[inline(always)]
pub fn find_surfaces(map: &DepthMap, grid: &Grid, depth_step: f32, cells: &mut Vec<Cell>, ranges: &mut [Vec<f32>; 2]) {
    let size = (map.width as usize, map.height as usize);
    let (across, down) = grid.cell_counts();
    let [nearest_m, farthest_m] = ranges;
    cells.clear();
    for row in 0..down {
        let [_, lines] = grid.cell_range((0, row), size);
        // Column-wise minima and maxima first, which vectorises.
        for range in [&mut *nearest_m, &mut *farthest_m] {
            range.clear();
            range.extend_from_slice(&map.metres[lines.start.min(size.1 - 1) * size.0..][..size.0]);
        }
        for line in lines.skip(1) {
            let line = &map.metres[line * size.0..][..size.0];
            for ((nearest, farthest), &metres) in nearest_m.iter_mut().zip(&mut *farthest_m).zip(line) {
                *nearest = if metres < *nearest { metres } else { *nearest };
                *farthest = if metres > *farthest { metres } else { *farthest };
            }
        }
        for column in 0..across {
            let [columns, _] = grid.cell_range((column, row), size);
            let nearest = nearest_m[columns.clone()].iter().copied().fold(f32::INFINITY, f32::min);
            let farthest = farthest_m[columns].iter().copied().fold(0.0, f32::max);
            let (near, far) = (DepthMap::inverse_depth(nearest), DepthMap::inverse_depth(farthest));
            let surface = |inverse: f32| Surface { inverse, ..Surface::default() };
            cells.push(match near - far > depth_step {
                true => Cell {
                    near: surface(near),
                    far: Some(surface(far)),
                    split_m: 2.0 / (near + far),
                    is_untextured: false,
                },
                false => Cell { near: surface(near), far: None, split_m: f32::INFINITY, is_untextured: false },
            });
        }
    }
}

impl Pictures<'_> {
    /// Compares all cells at rest. Returns the threshold of the change, in codes, up to which a surface is at rest.
    #[inline(always)]
    pub fn compare_at_rest(&mut self, cells: &mut [Cell], changes: &mut Vec<f32>) -> f32 {
        changes.clear();
        for (at, cell) in cells.iter_mut().enumerate() {
            let residual = self.mean_difference(self.cell_position(at), [0; 2], None).unwrap_or(0.0);
            for is_near in [true, false] {
                cell.surface_mut(is_near).into_iter().for_each(|surface| {
                    *surface = Surface {
                        inverse: surface.inverse,
                        difference_at_rest: residual,
                        residual,
                        is_known: true,
                        vector: [0; 2],
                    };
                });
            }
            changes.push(residual);
        }
        let middle = changes.len() / 2;
        let median = *changes.select_nth_unstable_by(middle, f32::total_cmp).1;
        let rest_threshold = (REST_FACTOR * median).clamp(REST_BOUNDS.0, REST_BOUNDS.1);
        for (at, cell) in cells.iter_mut().enumerate() {
            cell.is_untextured = false;
            if cell.far.is_some() && cell.near.difference_at_rest > WHOLE_CELL_FACTOR * rest_threshold {
                let whole = cell.near.difference_at_rest;
                self.compare_surfaces(self.cell_position(at), cell);
                let changes = whole > rest_threshold || !cell.is_at_rest(rest_threshold);
                if cell.near.is_known && cell.near.difference_at_rest <= rest_threshold && changes {
                    cell.is_untextured = true;
                    self.compare_surfaces(self.cell_position(at), cell);
                }
            }
        }
        rest_threshold
    }

    #[inline(always)]
    fn compare_surfaces(&mut self, place: (usize, usize), cell: &mut Cell) {
        self.compute_mask(place, cell.split_m, cell.is_untextured);
        for is_near in [true, false] {
            let residual = self.mean_difference(place, [0; 2], Some(is_near));
            if let Some(surface) = cell.surface_mut(is_near) {
                (surface.difference_at_rest, surface.is_known) = (residual.unwrap_or(0.0), residual.is_some());
                surface.residual = surface.difference_at_rest;
            }
        }
    }

    /// Adopts a vector for a surface if it is the best so far.
    #[inline(always)]
    fn try_vector(&self, place: (usize, usize), is_near: Option<bool>, surface: &mut Surface, vector: Vector) {
        let length_px = |vector: Vector| (vector[0].abs() + vector[1].abs()) as f32;
        let most = surface.residual + COST_PER_PX * (length_px(surface.vector) - length_px(vector));
        if let Some(residual) = self.mean_difference(place, vector, is_near).filter(|residual| *residual < most) {
            (surface.residual, surface.vector) = (residual, vector);
        }
    }

    /// Estimates the motion of all surfaces that are not at rest.
    #[inline(always)]
    pub fn refine_vectors(&mut self, cells: &mut [Cell], blocks: &BlockMatcher, rest_threshold: f32) {
        let grid = self.grid.cell_counts();
        let scale = (self.grid.cell_px / CELL) as i32;
        for (at, cell) in cells.iter_mut().enumerate().filter(|(_, cell)| !cell.is_at_rest(rest_threshold)) {
            let place = self.cell_position(at);
            let is_split = cell.far.is_some();
            if is_split {
                self.compute_mask(place, cell.split_m, cell.is_untextured);
            }
            // Start from the block vectors of the cell and its neighbours, then refine with halved steps.
            let (mut rough, mut count) = ([[0; 2]; 9], 0);
            for place in [place].into_iter().chain(neighbours(place, grid)) {
                let vector = blocks.cell_vector(place).map(|px| scale * px);
                if vector != [0; 2] && !rough[..count].contains(&vector) {
                    rough[count] = vector;
                    count += 1;
                }
            }
            for is_near in [true, false] {
                let Some(surface) = cell
                    .surface_mut(is_near)
                    .filter(|surface| surface.is_known && surface.difference_at_rest > rest_threshold)
                else {
                    continue;
                };
                let compared = is_split.then_some(is_near);
                for &vector in &rough[..count] {
                    self.try_vector(place, compared, surface, vector);
                }
                let mut step = (scale / 2).max(1);
                while step > 0 {
                    let [x, y] = surface.vector;
                    for by in STEPS {
                        self.try_vector(place, compared, surface, [x + step * by[0], y + step * by[1]]);
                    }
                    if surface.vector == [x, y] || step > 1 {
                        step /= 2;
                    }
                }
                if surface.residual > MAX_RESIDUAL_RATIO * surface.difference_at_rest {
                    (surface.vector, surface.residual, surface.is_known) = ([0; 2], surface.difference_at_rest, false);
                }
            }
            if cell.is_untextured {
                // The dilated mask moved; the surface's own pixels must match there too, or else it stays at rest.
                self.compute_mask(place, cell.split_m, false);
                if self
                    .mean_difference(place, cell.near.vector, Some(true))
                    .is_none_or(|residual| residual > rest_threshold)
                {
                    cell.near =
                        Surface { vector: [0; 2], is_known: true, difference_at_rest: 0.0, residual: 0.0, ..cell.near };
                }
            }
        }
    }

    /// Replaces outlier vectors and unknown ones by the median of the neighbours, if it matches about as well.
    #[inline(always)]
    pub fn smooth_vectors(&mut self, cells: &mut [Cell], rest_threshold: f32) {
        let grid = self.grid.cell_counts();
        let count = cells.len();
        // Forwards, then backwards, so that known vectors propagate from all sides.
        for at in (0..count).chain((0..count).rev()) {
            let (place, is_split, mut is_marked) = (self.cell_position(at), cells[at].far.is_some(), false);
            for is_near in [true, false] {
                let Some(&mut surface) = cells[at].surface_mut(is_near) else { continue };
                if surface.is_known && surface.difference_at_rest <= REST_BOUNDS.0 {
                    continue;
                }
                // From each neighbour, the surface at a similar depth.
                let (mut vectors, mut count) = ([[0; 8]; 2], 0);
                for (column, row) in neighbours(place, grid) {
                    let other = cells[row * grid.0 + column].closest_surface(surface.inverse);
                    if other.is_known && (other.inverse - surface.inverse).abs() <= SAME_SURFACE * surface.inverse {
                        (vectors[0][count], vectors[1][count]) = (other.vector[0], other.vector[1]);
                        count += 1;
                    }
                }
                let median = vectors.map(|mut px| {
                    px[..count].sort_unstable();
                    px[count / 2]
                });
                if count < 2 || surface.is_known && median == surface.vector {
                    continue;
                }
                if is_split && !is_marked {
                    self.compute_mask(place, cells[at].split_m, cells[at].is_untextured);
                    is_marked = true;
                }
                let residual = self.mean_difference(place, median, is_split.then_some(is_near));
                let as_good = match surface.is_known {
                    true if surface.difference_at_rest <= rest_threshold => {
                        residual.is_some_and(|residual| residual <= MAX_RESIDUAL_RATIO * surface.difference_at_rest)
                    }
                    true => residual.is_none_or(|residual| residual <= ADOPTION_RATIO * surface.residual),
                    false => residual.is_none_or(|residual| residual <= surface.difference_at_rest),
                };
                if let Some(surface) = cells[at].surface_mut(is_near).filter(|_| as_good) {
                    (surface.vector, surface.is_known) = (median, true);
                }
            }
        }
    }
}
