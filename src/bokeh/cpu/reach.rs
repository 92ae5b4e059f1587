//! Pass `reach`: on the coarse grid, what the filters can reach from each cell: the radius of the content there (its
//! mean, weighted by coverage and nearness), and the range of its colours.

use super::rows::{CELL_PLANES, Cells};
use crate::bokeh::plan::{Bin, CELL, Plan};

/// Weight of far cells, so that a radius exists wherever the filter finds anything at all.
const FAR_WEIGHT: f32 = 0.02;

/// Weight of a cell `distance` cells away, along one axis.
pub fn nearness(distance: usize, bin: &Bin) -> f32 {
    let sigma = (bin.max_radius_px / (2.0 * CELL as f32)).max(0.5);
    let d = distance as f32 / sigma;
    (-0.5 * d * d).exp() + FAR_WEIGHT
}

/// The two passes of the separable neighbourhood; `scratch` holds as many values as the grid.
pub fn reach(plan: &Plan, bin: &Bin, cells: &Cells, out: &mut Cells, scratch: &mut Vec<f32>) {
    let (width, height, radius) = (cells.width, cells.height, plan.reach_cells(bin));
    let mut weights = [0.0; 64];
    let radius = radius.min(weights.len() - 1);
    (0..=radius).for_each(|d| weights[d] = nearness(d, bin));
    scratch.clear();
    scratch.resize(cells.data.len(), 0.0);
    for y in 0..height {
        for plane in 0..CELL_PLANES {
            let source = cells.plane(y, plane);
            let target = &mut scratch[(y * CELL_PLANES + plane) * width..][..width];
            for (x, value) in target.iter_mut().enumerate() {
                let (from, to) = (x.saturating_sub(radius), (x + radius).min(width - 1));
                *value = gather(plane, (from..=to).map(|k| (source[k], weights[k.abs_diff(x)])));
            }
        }
    }
    for y in 0..height {
        let (from, to) = (y.saturating_sub(radius), (y + radius).min(height - 1));
        for plane in 0..CELL_PLANES {
            let target = &mut out.data[(y * CELL_PLANES + plane) * width..][..width];
            target.fill(if plane < 2 {
                0.0
            } else if plane < 5 {
                f32::INFINITY
            } else {
                f32::NEG_INFINITY
            });
            for k in from..=to {
                let source = &scratch[(k * CELL_PLANES + plane) * width..][..width];
                let weight = weights[k.abs_diff(y)];
                match plane {
                    0 | 1 => target.iter_mut().zip(source).for_each(|(t, s)| *t += weight * s),
                    2..5 => target.iter_mut().zip(source).for_each(|(t, s)| *t = t.min(*s)),
                    _ => target.iter_mut().zip(source).for_each(|(t, s)| *t = t.max(*s)),
                }
            }
        }
        let row = &mut out.data[y * CELL_PLANES * width..][..CELL_PLANES * width];
        let (coverage, rest) = row.split_at_mut(width);
        let (radius_px, range) = rest.split_at_mut(width);
        for (radius_px, coverage) in radius_px.iter_mut().zip(coverage) {
            let coc_px = if *coverage > 0.0 { *radius_px / *coverage } else { 0.0 };
            *radius_px = plan.bin_radius_px(bin, coc_px);
        }
        // Where nothing is in reach there is nothing to keep in range; zero keeps the arithmetic finite.
        range.iter_mut().filter(|value| !value.is_finite()).for_each(|value| *value = 0.0);
    }
}

#[inline(always)]
fn gather(plane: usize, values: impl Iterator<Item = (f32, f32)>) -> f32 {
    match plane {
        0 | 1 => values.map(|(value, weight)| value * weight).sum(),
        2..5 => values.map(|(value, _)| value).fold(f32::INFINITY, f32::min),
        _ => values.map(|(value, _)| value).fold(f32::NEG_INFINITY, f32::max),
    }
}
