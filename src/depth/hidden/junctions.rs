//! T-junctions: where a near thing covers the outline between two surfaces behind it, that outline goes on straight.

use std::ops::Range;

use super::labels::Labels;
use super::survey::{Found, OutlinePoint, SAME_PX, Seed};
use super::{CELL, Cells, Frame, Grid};
use crate::frame::resize_buffer;

/// Longest distance from an outline's end to the near thing, in pixels.
const GAP_PX: f32 = 2.5;
/// Length of the outline's end that gives the direction, in pixels, and where the weight falls to 1/e. **Fragile**: 6 to 10
/// are alike; with 14 one of the three scenes on which it was chosen loses 1.6 dB.
const END_PX: f32 = 8.0;
const FALL_PX: f32 = 0.6 * END_PX;
/// Number of points from which on there is a direction.
const MIN_POINTS: usize = 4;
/// CoC difference up to which a farther surface is the same one, in pixels.
const SAME_FAR_PX: f32 = 2.5;
/// An outline goes on for this factor of the larger radius plus [`BEYOND_PX`].
const REACH: f32 = 1.3;
const BEYOND_PX: f32 = 6.0;
/// Half the width of a thing, in pixels, from which on outlines go on behind it: behind a thinner one, both ends are seen.
const MIN_DEPTH_PX: f32 = 3.0;
const DEPTH_WITHIN_CELLS: usize = 3;
/// Largest distance of points of one end, in pixels.
const JOINED_PX: f32 = 3.0;
/// With more points on outlines than this, depth is noise.
const MAX_POINTS: usize = 1 << 15;
const MAX_JUNCTIONS: usize = 1 << 10;
/// Ridges of the line's fit.
const RIDGES: [f32; 2] = [1e-6, 1e-3];

/// Carries outlines on; owns the memory for it.
#[derive(Debug, Default)]
pub struct Junctions {
    /// Points at a near thing: index, distance to it in pixels, and whether they belong to an end that is done.
    ends: Vec<(usize, f32, bool)>,
    /// Points of an end that are to be looked at.
    stack: Vec<usize>,
    /// Squared distance of each hidden cell to the junction that decided it, in pixels.
    square: Vec<f32>,
}

/// An outline's end, and how it goes on.
struct Junction {
    point: OutlinePoint,
    /// Largest CoC of the picture, in pixels.
    max_coc_px: f32,
    /// Unit vectors along the outline, towards the near thing, and across.
    along: (f32, f32),
    /// The line in these coordinates: offset, and slope.
    line: [f32; 2],
    /// 1 or -1: the side of the nearer surface.
    nearer_side: f32,
}

impl Junctions {
    /// Corrects the surfaces behind hidden cells.
    pub fn carry_outlines_on(&mut self, grid: &Grid, frame: &Frame, found: &Found, cells: &Cells, labels: &mut Labels) {
        let points = &found.outlines[..];
        if points.len() > MAX_POINTS || labels.rows.0 >= labels.rows.1 {
            return;
        }
        self.ends.clear();
        for (k, point) in points.iter().enumerate() {
            if let Some(gap_px) = gap_px(grid, frame, &cells.nearest_px, point) {
                self.ends.push((k, gap_px, false));
            }
        }
        if self.ends.is_empty() || self.ends.len() > MAX_POINTS / 8 {
            return;
        }
        resize_buffer(&mut self.square, cells.nearest_px.len());
        for y in labels.rows.0..labels.rows.1 {
            self.square[y * grid.across + grid.columns.0..y * grid.across + grid.columns.1].fill(f32::INFINITY);
        }
        let mut count = 0;
        for k in 0..self.ends.len() {
            if self.ends[k].2 {
                continue;
            }
            let nearest = self.join(points, k);
            if count == MAX_JUNCTIONS || !is_at_thick_thing(grid, labels, &points[nearest]) {
                continue;
            }
            if let Some(junction) = Junction::fit(points, nearest, frame.lens.max_coc_px) {
                count += 1;
                self.decide(grid, &junction, (&found.seeds, &cells.nearest_px), labels);
            }
        }
    }

    /// Marks all points of the same end as done; returns the index of the one nearest to the near thing.
    fn join(&mut self, points: &[OutlinePoint], first: usize) -> usize {
        let Self { ends, stack, .. } = self;
        let of = points[ends[first].0];
        stack.clear();
        stack.push(first);
        ends[first].2 = true;
        let mut best = (ends[first].1, ends[first].0);
        while let Some(k) = stack.pop() {
            let (from, gap_px, _) = ends[k];
            if (gap_px, from) < best {
                best = (gap_px, from);
            }
            let near = |at: (f32, f32)| {
                let from = points[from].at;
                (at.0 - from.0).abs() <= JOINED_PX && (at.1 - from.1).abs() <= JOINED_PX
            };
            for (other, (index, _, is_done)) in ends.iter_mut().enumerate() {
                let point = &points[*index];
                if !*is_done && near(point.at) && point.is_like(&of) {
                    *is_done = true;
                    stack.push(other);
                }
            }
        }
        best.1
    }

    /// Decides the surface behind the hidden cells to which the outline reaches, where no junction is nearer.
    fn decide(
        &mut self,
        grid: &Grid,
        junction: &Junction,
        (seeds, nearest_px): (&[Seed], &[f32]),
        labels: &mut Labels,
    ) {
        let [near_px, far_px] = junction.point.cocs_px;
        let from = junction.point.at;
        let reach_px = |own_px: f32| REACH * (far_px.abs().max(own_px.abs()) + BEYOND_PX);
        let most_px = reach_px(junction.max_coc_px);
        let cells = |middle: f32, first: usize, end: usize| {
            let low = ((middle - most_px).max(0.0) as usize / CELL).max(first);
            low..((middle + most_px) as usize / CELL + 1).min(end)
        };
        for y in cells(from.1, labels.rows.0, labels.rows.1) {
            for x in cells(from.0, grid.columns.0, grid.columns.1) {
                let cell = y * grid.across + x;
                if labels.mask[cell] == 0 {
                    continue;
                }
                let behind_px = labels.seed(seeds, cell).behind_px;
                let at = grid.centre_px(x, y);
                let (x, y) = (at.0 - from.0, at.1 - from.1);
                let square = x * x + y * y;
                let limit_px = reach_px(nearest_px[cell]);
                let is_either = (behind_px - near_px).abs() < SAME_PX || (behind_px - far_px).abs() < SAME_FAR_PX;
                if let Some(is_nearer) = junction.is_nearer_at(x, y)
                    && is_either
                    && square < self.square[cell].min(limit_px * limit_px)
                {
                    self.square[cell] = square;
                    labels.behind_px[cell] = if is_nearer { near_px } else { far_px };
                }
            }
        }
    }
}

impl OutlinePoint {
    /// Whether both are between the same two surfaces.
    fn is_like(&self, other: &Self) -> bool {
        (self.cocs_px[0] - other.cocs_px[0]).abs() < SAME_PX && (self.cocs_px[1] - other.cocs_px[1]).abs() < SAME_FAR_PX
    }
}

impl Junction {
    /// Fits a line to the end of an outline at this point.
    fn fit(points: &[OutlinePoint], at: usize, max_coc_px: f32) -> Option<Self> {
        let point = points[at];
        let rows = |px: f32| points.partition_point(|other| other.at.1 < px);
        let nearby = &points[rows(point.at.1 - END_PX - 1.0)..rows(point.at.1 + END_PX + 1.0)];
        // Offset from the end, and weight.
        let end = || {
            nearby.iter().filter(|other| other.is_like(&point)).filter_map(|other| {
                let (x, y) = (other.at.0 - point.at.0, other.at.1 - point.at.1);
                let square = x * x + y * y;
                (square <= END_PX * END_PX).then(|| (x, y, (-square / (FALL_PX * FALL_PX)).exp(), other.nearer))
            })
        };
        if end().count() < MIN_POINTS {
            return None;
        }
        let (sum, x, y) = end().fold((0.0, 0.0, 0.0), |all, (x, y, w, _)| (all.0 + w, all.1 + w * x, all.2 + w * y));
        let (mean_x, mean_y) = (x / sum, y / sum);
        let (xx, xy, yy) = end().fold((0.0, 0.0, 0.0), |all, (x, y, w, _)| {
            let (x, y) = (x - mean_x, y - mean_y);
            (all.0 + w * x * x, all.1 + w * x * y, all.2 + w * y * y)
        });
        let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
        // From the middle of the points, the end is towards the near thing.
        let plain = end().fold((0.0, 0.0), |all, (x, y, ..)| (all.0 + x, all.1 + y));
        let sign = if plain.0 * angle.cos() + plain.1 * angle.sin() > 0.0 { -1.0 } else { 1.0 };
        let along = (sign * angle.cos(), sign * angle.sin());
        let turned = |x: f32, y: f32| (x * along.0 + y * along.1, y * along.0 - x * along.1);
        let [mut uu, mut u1, mut uv, mut v1, mut side] = [0.0f32; 5];
        for (x, y, w, nearer) in end() {
            let (u, v) = turned(x, y);
            (uu, u1, uv, v1) = (uu + w * u * u, u1 + w * u, uv + w * u * v, v1 + w * v);
            side += w * turned(nearer.0, nearer.1).1;
        }
        let (one, uu) = (sum + RIDGES[0], uu + RIDGES[1]);
        let determinant = one * uu - u1 * u1;
        let line = [(uu * v1 - u1 * uv) / determinant, (one * uv - u1 * v1) / determinant];
        let nearer_side = if side < 0.0 { -1.0 } else { 1.0 };
        line[0].is_finite().then_some(Self { point, max_coc_px, along, line, nearer_side })
    }

    /// Whether the nearer surface is at this offset from the end, in pixels; `None` before the end.
    #[inline(always)]
    fn is_nearer_at(&self, x: f32, y: f32) -> Option<bool> {
        let (u, v) = (x * self.along.0 + y * self.along.1, y * self.along.0 - x * self.along.1);
        (u > -1.0).then(|| (v - (self.line[0] + self.line[1] * u)) * self.nearer_side > 0.0)
    }
}

/// Returns the distance of a point from the nearest near pixel, in pixels; `None` if that is more than [`GAP_PX`].
fn gap_px(grid: &Grid, frame: &Frame, nearest_px: &[f32], point: &OutlinePoint) -> Option<f32> {
    let around = |at: f32, end: usize| (at - GAP_PX).max(0.0).ceil() as usize..((at + GAP_PX) as usize + 1).min(end);
    let (width, height) = grid.size;
    let (xs, ys) = (around(point.at.0, width), around(point.at.1, height));
    let cells = |pixels: &Range<usize>, (first, end): (usize, usize)| {
        (pixels.start / CELL).max(first)..(pixels.end.div_ceil(CELL)).min(end)
    };
    let columns = cells(&xs, grid.columns);
    let mut rows = cells(&ys, grid.rows);
    let is_near =
        rows.any(|y| nearest_px[y * grid.across..][columns.clone()].iter().any(|px| grid.hiding.is_front(*px)));
    if !is_near {
        return None;
    }
    let mut least = f32::INFINITY;
    for (x, y) in ys.flat_map(|y| xs.clone().map(move |x| (x, y))) {
        if grid.hiding.is_front(frame.coc_px(y * width + x)) {
            least = least.min((x as f32 - point.at.0).hypot(y as f32 - point.at.1));
        }
    }
    (least <= GAP_PX).then_some(least)
}

/// Whether the near thing at a point is thick enough that outlines go on behind it.
fn is_at_thick_thing(grid: &Grid, labels: &Labels, point: &OutlinePoint) -> bool {
    let around = |at: f32, (first, end): (usize, usize)| {
        let cell = at as usize / CELL;
        cell.saturating_sub(DEPTH_WITHIN_CELLS).max(first)..(cell + DEPTH_WITHIN_CELLS + 1).min(end)
    };
    let columns = around(point.at.0, grid.columns);
    let is_deep = |cell: usize| (MIN_DEPTH_PX * MIN_DEPTH_PX..f32::INFINITY).contains(&labels.square(cell));
    around(point.at.1, grid.rows).any(|y| columns.clone().any(|x| is_deep(y * grid.across + x)))
}
