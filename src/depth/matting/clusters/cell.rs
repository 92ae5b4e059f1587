//! Clusters of one cell: weighted sums over its near and its far surface.
//! twin: shaders/matte/clusters.wgsl

#![allow(clippy::needless_range_loop)] // Pixels and planes index several arrays at once.

use pulp::Simd;

use super::{CELL_PX, Cluster, FrameView, Sums};
use crate::compute::simd::load;
use crate::depth::bitmap::set_bits;
use crate::depth::matting::symmetric::outer_product;
use crate::frame::DepthMap;

/// Weight of edge pixels, which may be mixed themselves: so small that they only matter without pure pixels.
pub(in super::super) const AT_EDGE_WEIGHT: f32 = 4e-4;
/// Distance from an edge within which the map may be wrong, in pixels, and the weight of pixels there.
pub(in super::super) const CLOSE_PX: usize = 3;
pub(in super::super) const CLOSE_WEIGHT: f32 = 0.05;

/// Pixels of a cell. Every other one is sampled, as on a chessboard, which suffices.
const PIXELS: usize = CELL_PX * CELL_PX;
const SAMPLES: usize = PIXELS / 2;
/// One number per sample.
type Lanes = [f32; SAMPLES];

/// Indices of the samples in their cell, and their columns and rows.
const PLACES: [usize; SAMPLES] = {
    let (mut places, mut k) = ([0; SAMPLES], 0);
    while k < SAMPLES {
        let row = 2 * k / CELL_PX;
        places[k] = 2 * k + row % 2;
        k += 1;
    }
    places
};
const COLUMNS: Lanes = sample_coordinates(1);
const ROWS: Lanes = sample_coordinates(CELL_PX);

const fn sample_coordinates(step: usize) -> Lanes {
    let (mut along, mut k) = ([0.0; SAMPLES], 0);
    while k < SAMPLES {
        along[k] = (PLACES[k] / step % CELL_PX) as f32;
        k += 1;
    }
    along
}

/// Samples of a cell: inverse depth in 1/m, and linear light.
struct Samples {
    inverse: Lanes,
    light: [Lanes; 3],
}

impl Samples {
    /// Computes the cluster of the samples with these weights, in a cell whose top left pixel is `corner`.
    #[inline(always)]
    fn compute_cluster(&self, weight: &Lanes, corner: (usize, usize)) -> Cluster {
        let Self { inverse, light: [r, g, b] } = self;
        let (own_r, own_g, own_b) = (multiply_lanes(weight, r), multiply_lanes(weight, g), multiply_lanes(weight, b));
        let light = [sum_lanes(&own_r), sum_lanes(&own_g), sum_lanes(&own_b)];
        let [rr, rg, rb] = [
            sum_lanes(&multiply_lanes(&own_r, r)),
            sum_lanes(&multiply_lanes(&own_r, g)),
            sum_lanes(&multiply_lanes(&own_r, b)),
        ];
        let [gg, gb, bb] = [
            sum_lanes(&multiply_lanes(&own_g, g)),
            sum_lanes(&multiply_lanes(&own_g, b)),
            sum_lanes(&multiply_lanes(&own_b, b)),
        ];
        let sums = Sums([sum_lanes(weight), light[0], light[1], light[2], rr, rg, rb, gg, gb, bb, 0.0, 0.0]);
        let (columns, rows) = (sum_lanes(&multiply_lanes(weight, &COLUMNS)), sum_lanes(&multiply_lanes(weight, &ROWS)));
        Cluster::new(sums, [columns, rows, sum_lanes(&multiply_lanes(weight, inverse))], corner)
    }
}

#[inline(always)]
fn multiply_lanes(a: &Lanes, b: &Lanes) -> Lanes {
    let mut products = [0.0; SAMPLES];
    for k in 0..SAMPLES {
        products[k] = a[k] * b[k];
    }
    products
}

/// Sums all values, in the same order on every processor.
#[inline(always)]
fn sum_lanes(values: &Lanes) -> f32 {
    let mut quarters = [0.0; SAMPLES / 4];
    for k in 0..SAMPLES / 4 {
        let (a, b) = (values[k], values[k + SAMPLES / 4]);
        let (c, d) = (values[k + SAMPLES / 2], values[k + 3 * SAMPLES / 4]);
        quarters[k] = (a + b) + (c + d);
    }
    let [a, b, c, d, e, f, g, h] = quarters;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

/// Computes the clusters of a cell: one if its inverse depths differ by at most `depth_step`, or else those of the
/// nearest and the farthest surface; and that of the near surface's edge pixels.
#[inline(always)]
pub fn cluster_cell<S: Simd>(simd: S, view: &FrameView, column: usize, row: usize) -> [Cluster; 3] {
    let FrameView { size: (width, height), depth_step, at_edge, .. } = *view;
    let corner @ (left, top) = (column * CELL_PX, row * CELL_PX);
    let (across, down) = ((width - left).min(CELL_PX), (height - top).min(CELL_PX));
    // Beyond the picture, the last column and row are replicated.
    let mut values = [0.0; PIXELS];
    let mut codes = [[0; 3]; PIXELS];
    let (mut edges, mut beyond) = (0, 0);
    for (k, values) in values.as_chunks_mut::<CELL_PX>().0.iter_mut().enumerate() {
        let y = top + k.min(down - 1);
        let row = &view.rgb[3 * (y * width + left)..][..3 * across];
        codes[k * CELL_PX..][..across].copy_from_slice(row.as_chunks().0);
        let metres = &view.metres[y * width + left..][..across];
        values[..across].copy_from_slice(metres);
        values[across..].fill(metres[across - 1]);
        let missing = if k < down { ROW & !0 << across } else { ROW };
        edges |= (at_edge.word_at(left, y) & ROW & !missing) << (k * CELL_PX);
        beyond |= missing << (k * CELL_PX);
    }
    for value in &mut values {
        *value = DepthMap::inverse_depth(*value);
    }
    // Weights: pixels at or near edges count little, replicated ones nothing.
    let close = pixels_near_edges(view, left, top);
    let (mut weights, mut is_edge) = ([0.0; PIXELS], [0.0; PIXELS]);
    for k in 0..PIXELS {
        let is = |bits: u64| bits >> k & 1 != 0;
        is_edge[k] = if is(edges | beyond) { 1.0 } else { 0.0 };
        let weight = if is(close) { CLOSE_WEIGHT } else { 1.0 };
        weights[k] = if is(edges) { AT_EDGE_WEIGHT } else { weight };
        weights[k] = if is(beyond) { 0.0 } else { weights[k] };
    }
    // One surface or two, by the pure pixels if there are any.
    let (pure, all) = value_ranges(simd, &values, &is_edge);
    let (high, low) = if pure.0 >= pure.1 { pure } else { all };
    let is_one = high - low <= depth_step;
    let tolerance = if is_one { 2.0 * depth_step } else { depth_step };
    let zeros = [0.0; SAMPLES];
    let mut samples = Samples { inverse: zeros, light: [zeros; 3] };
    let [mut near, mut far] = [zeros; 2];
    for k in 0..SAMPLES {
        let (place, code) = (PLACES[k], &codes[PLACES[k]]);
        for p in 0..3 {
            samples.light[p][k] = view.light[usize::from(code[p])];
        }
        (samples.inverse[k], near[k]) = (values[place], weights[place]);
    }
    for k in 0..SAMPLES {
        let is_far = !is_one & (samples.inverse[k] <= 0.5 * (high + low));
        let off = (samples.inverse[k] - if is_far { low } else { high }).abs();
        let weight = if off > tolerance { 0.0 } else { near[k] };
        near[k] = if is_far { 0.0 } else { weight };
        far[k] = if is_far { weight } else { 0.0 };
    }
    let far = if is_one { Cluster::default() } else { samples.compute_cluster(&far, corner) };
    let near = samples.compute_cluster(&near, corner);
    let fringe = match all.0 - all.1 > depth_step {
        true => cluster_fringe(view, &values, edges, 0.5 * (all.0 + all.1), corner),
        false => Cluster::default(),
    };
    [near, far, fringe]
}

/// Computes the cluster of the pixels at `edges` that have more than the inverse depth `middle`.
#[inline(always)]
fn cluster_fringe(
    view: &FrameView,
    values: &[f32; PIXELS],
    edges: u64,
    middle: f32,
    corner @ (left, top): (usize, usize),
) -> Cluster {
    let (mut sums, mut of_place) = (Sums::default(), [0.0; 3]);
    for place in set_bits(edges) {
        let value = values[place];
        if value > middle {
            let (x, y) = (place % CELL_PX, place / CELL_PX);
            let light = view.light((top + y) * view.size.0 + left + x);
            let ([r, g, b], [rr, rg, rb, gg, gb, bb]) = (light, outer_product(light));
            sums.add(1.0, &Sums([1.0, r, g, b, rr, rg, rb, gg, gb, bb, 0.0, 0.0]));
            of_place = [of_place[0] + x as f32, of_place[1] + y as f32, of_place[2] + value];
        }
    }
    Cluster::new(sums, of_place, corner)
}

/// Bits of one row of a cell.
const ROW: u64 = (1 << CELL_PX) - 1;

/// Returns the largest and the smallest value of those not at an edge, and of all.
#[inline(always)]
fn value_ranges<S: Simd>(simd: S, values: &[f32; PIXELS], is_edge: &[f32; PIXELS]) -> ((f32, f32), (f32, f32)) {
    let (zero, beyond) = (simd.splat_f32s(0.0), simd.splat_f32s(f32::INFINITY));
    let (mut high, mut low, mut pure_high, mut pure_low) = (zero, beyond, zero, beyond);
    for at in (0..PIXELS).step_by(S::F32_LANES) {
        let value = load::<S>(values, at);
        let is_edge = simd.greater_than_f32s(load::<S>(is_edge, at), zero);
        (high, low) = (simd.max_f32s(high, value), simd.min_f32s(low, value));
        pure_high = simd.max_f32s(pure_high, simd.select_f32s(is_edge, zero, value));
        pure_low = simd.min_f32s(pure_low, simd.select_f32s(is_edge, beyond, value));
    }
    let [pure, all] =
        [[pure_high, pure_low], [high, low]].map(|[high, low]| (simd.reduce_max_f32s(high), simd.reduce_min_f32s(low)));
    (pure, all)
}

/// Returns a bit for each pixel of a cell that is at an edge or within [`CLOSE_PX`] of one.
#[inline(always)]
fn pixels_near_edges(view: &FrameView, left: usize, top: usize) -> u64 {
    let first = left.saturating_sub(CLOSE_PX);
    let mut rows = [0u64; CELL_PX + 2 * CLOSE_PX];
    for (k, row) in rows.iter_mut().enumerate() {
        let y = top + k;
        if (CLOSE_PX..view.size.1 + CLOSE_PX).contains(&y) {
            let edges = view.at_edge.word_at(first, y - CLOSE_PX) << (first + CLOSE_PX - left);
            // Bit 0, column `left` of the cell, covers the first `2 CLOSE_PX + 1` columns.
            for by in 0..=2 * CLOSE_PX {
                *row |= edges >> by;
            }
        }
    }
    let mut close = 0;
    for k in 0..CELL_PX {
        let mut of_row = 0;
        for row in &rows[k..=k + 2 * CLOSE_PX] {
            of_row |= row;
        }
        close |= (of_row & ROW) << (k * CELL_PX);
    }
    close
}
