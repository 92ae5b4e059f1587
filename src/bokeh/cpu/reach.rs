//! Pass `reach`, a dilation of radii on the coarse grid. Each cell gets the mean radius of the content within the
//! filter support, weighted by coverage and nearness, and the range of its colours.
//!
//! twin: shaders/blur/reach.wgsl

#![allow(clippy::needless_range_loop)] // Planes and distances index several arrays at once.

use pulp::{Simd, WithSimd};

use super::rows::{CELL_PLANES, CellGrid, EDGE_VALUES, NO_COLOR, SegmentEdges};
use crate::bokeh::plan::{Bin, CELL, MIN_CELL_WEIGHT, Plan, SEGMENT, UNBOUNDED_COLOR};

/// Returns the weight of a cell `distance` cells away, along one axis: a Gaussian plus [`MIN_CELL_WEIGHT`].
pub fn cell_weight(distance: usize, bin: &Bin) -> f32 {
    let d = distance as f32 / bin.sigma_cells();
    (-0.5 * d * d).exp() + MIN_CELL_WEIGHT
}

/// Combines the neighbourhood of every cell of a bin, one axis after the other, and writes radius and colour range at
/// the `edges` of segments.
pub struct DilateRadii<'a> {
    pub plan: &'a Plan,
    pub bin: &'a Bin,
    pub cells: &'a CellGrid,
    pub edges: &'a mut SegmentEdges,
    /// Grows to the size of the grid plus one row of it.
    pub scratch: &'a mut Vec<f32>,
}

impl WithSimd for DilateRadii<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        dilate_radii(simd, self.plan, self.bin, self.cells, self.edges, self.scratch);
    }
}

#[inline(always)]
fn dilate_radii<S: Simd>(
    simd: S,
    plan: &Plan,
    bin: &Bin,
    cells: &CellGrid,
    edges: &mut SegmentEdges,
    scratch: &mut Vec<f32>,
) {
    let (width, height, radius) = (cells.width, cells.height, plan.radius_cells(bin));
    // Only blurs of thousands of pixels have a larger radius; they are clamped.
    let mut weights = [0.0; 64];
    let radius = radius.min(weights.len() - 1);
    (0..=radius).for_each(|d| weights[d] = cell_weight(d, bin));
    let row_len = CELL_PLANES * width;
    // Everything is written before it is read.
    scratch.resize(scratch.len().max(cells.data.len() + row_len), 0.0);
    let (across, row) = scratch[..cells.data.len() + row_len].split_at_mut(cells.data.len());
    for (k, (source, target)) in cells.data.chunks_exact(width).zip(across.chunks_exact_mut(width)).enumerate() {
        combine_row(simd, k % CELL_PLANES, source, target, &weights[..=radius]);
    }
    for y in 0..height {
        row[..2 * width].fill(0.0);
        row[2 * width..5 * width].fill(NO_COLOR);
        row[5 * width..].fill(-NO_COLOR);
        for k in y.saturating_sub(radius)..(y + radius + 1).min(height) {
            let source = &across[k * row_len..][..row_len];
            let weight = weights[k.abs_diff(y)];
            let (sums, rest) = row.split_at_mut(2 * width);
            let (lows, highs) = rest.split_at_mut(3 * width);
            add_weighted(sums, source, weight);
            assign_min(simd, lows, &source[2 * width..5 * width]);
            assign_max(simd, highs, &source[5 * width..]);
        }
        // The mean of |CoC| becomes the radius.
        for x in 0..width {
            let coc_px = if row[x] > 0.0 { row[width + x] / row[x] } else { 0.0 };
            row[width + x] = plan.bin_radius_px(bin, coc_px);
        }
        if plan.has_overshoot(bin) {
            // Without content in the support there is no range to clamp to.
            row[2 * width..].iter_mut().filter(|value| value.abs() >= NO_COLOR).for_each(|value| *value = 0.0);
        } else {
            row[2 * width..5 * width].fill(-UNBOUNDED_COLOR);
            row[5 * width..].fill(UNBOUNDED_COLOR);
        }
        let out = &mut edges.data[y * edges.across * EDGE_VALUES..][..edges.across * EDGE_VALUES];
        for (edge, values) in out.chunks_exact_mut(EDGE_VALUES).enumerate() {
            // An edge is between two cells, or at an end of the row: the mean of both sides.
            let right = edge * SEGMENT / CELL;
            let (left, right) = (right.saturating_sub(1), right.min(width - 1));
            for (plane, value) in values.iter_mut().take(CELL_PLANES - 1).enumerate() {
                let plane = &row[(plane + 1) * width..];
                *value = 0.5 * (plane[left] + plane[right]);
            }
        }
    }
}

/// Combines each cell of a plane's row with those up to `weights.len() - 1` cells away: weighted sums in planes 0 and
/// 1, minima in planes 2 to 4, maxima in planes 5 to 7.
#[inline(always)]
fn combine_row<S: Simd>(simd: S, plane: usize, source: &[f32], target: &mut [f32], weights: &[f32]) {
    target.copy_from_slice(source);
    if plane < 2 {
        for value in target.iter_mut() {
            *value *= weights[0];
        }
    }
    for distance in 1..weights.len().min(source.len()) {
        let inner = source.len() - distance;
        for (to, from) in [(0, distance), (distance, 0)] {
            let (target, source) = (&mut target[to..][..inner], &source[from..][..inner]);
            match plane {
                0 | 1 => add_weighted(target, source, weights[distance]),
                2..5 => assign_min(simd, target, source),
                _ => assign_max(simd, target, source),
            }
        }
    }
}

#[inline(always)]
fn add_weighted(target: &mut [f32], source: &[f32], weight: f32) {
    for (target, source) in target.iter_mut().zip(source) {
        *target += weight * source;
    }
}

#[inline(always)]
fn assign_min<S: Simd>(simd: S, target: &mut [f32], source: &[f32]) {
    assert_eq!(target.len(), source.len());
    let ((targets, target), (sources, source)) = (S::as_mut_simd_f32s(target), S::as_simd_f32s(source));
    for (target, &source) in targets.iter_mut().zip(sources) {
        *target = simd.min_f32s(source, *target);
    }
    for (target, &source) in target.iter_mut().zip(source) {
        *target = if source < *target { source } else { *target };
    }
}

#[inline(always)]
fn assign_max<S: Simd>(simd: S, target: &mut [f32], source: &[f32]) {
    assert_eq!(target.len(), source.len());
    let ((targets, target), (sources, source)) = (S::as_mut_simd_f32s(target), S::as_simd_f32s(source));
    for (target, &source) in targets.iter_mut().zip(sources) {
        *target = simd.max_f32s(source, *target);
    }
    for (target, &source) in target.iter_mut().zip(source) {
        *target = if source > *target { source } else { *target };
    }
}
