//! The colours of surfaces, in clusters: a square cell of pixels has one of each surface that it shows, at most two.
//!
//! What is wanted around a mixed pixel are means and covariances of both surfaces, close by where there are pure pixels
//! and from some way off where there are none, as in hair. Cells have both for a tenth of the time that pixels need.

mod answers;

use super::contrast::Contrast;
use super::symmetric::{Symmetric, outer};
use super::{larger, light_of, smaller};
use crate::depth::bits::{Bits, places};
use crate::frame::DepthMap;

pub(super) use answers::Clusters;

/// Side of a cell, in pixels.
const CELL_PX: usize = 8;
/// Pixels at an edge may be mixed themselves. They count so little that they matter only where nothing is pure.
const AT_EDGE_WEIGHT: f32 = 4e-4;
/// So many pixels beside an edge, too, the map may be wrong: they count less than those further away.
const CLOSE_PX: usize = 3;
const CLOSE_WEIGHT: f32 = 0.02;

/// The place of the cluster of the near surface's pixels at edges, after those of the near and the far surface.
const FRINGE: usize = 2;
/// So much of a pixel at an edge that the map gives to the near surface is that, on average.
const FRINGE_SHARE: f32 = 0.75;
/// From the first share down, the colour of such pixels is not that of the near surface; from the second up, it is.
const FRINGE_SHARES: [f32; 2] = [-0.1, 0.25];

/// Pixels of one surface in a cell, weighted.
#[derive(Clone, Copy, Debug, Default)]
struct Cluster {
    sums: Sums,
    /// Means of position and inverse depth.
    x: f32,
    y: f32,
    inverse: f32,
}

impl Cluster {
    /// Of the total weight of pixels, and with it their light, its products, and their positions and inverse depths.
    #[inline(always)]
    fn of_sums(weight: f32, [r, g, b]: [f32; 3], of_light: ([f32; 3], [f32; 3]), [x, y, inverse]: [f32; 3]) -> Self {
        let ([rr, rg, rb], [gg, gb, bb]) = of_light;
        let scale = if weight > 0.0 { 1.0 / weight } else { 0.0 };
        let sums = Sums([weight, r, g, b, rr, rg, rb, gg, gb, bb, 0.0, 0.0]);
        Self { sums, x: scale * x, y: scale * y, inverse: scale * inverse }
    }
}

/// Sums over pixels: the weight, and with it their light and the products of that; ten, and up to whole vectors.
#[derive(Clone, Copy, Debug, Default)]
struct Sums([f32; 12]);

impl Sums {
    #[inline(always)]
    fn weight(&self) -> f32 {
        self.0[0]
    }

    #[inline(always)]
    fn color(&self) -> Color {
        let [weight, x, y, z, xx, xy, xz, yy, yz, zz, ..] = self.0;
        Color::of_sums(weight, [x, y, z], [xx, xy, xz, yy, yz, zz])
    }

    #[inline(always)]
    fn add(&mut self, weight: f32, other: &Self) {
        for k in 0..self.0.len() {
            self.0[k] += weight * other.0[k];
        }
    }
}

/// Mean and covariance of a surface's colours in linear light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Color {
    pub mean: [f32; 3],
    pub covariance: Symmetric,
}

impl Color {
    /// Of pixels of this total weight, and the weighted sums of their light and of the products of that.
    #[inline(always)]
    pub(super) fn of_sums(weight: f32, light: [f32; 3], squares: Symmetric) -> Self {
        let mean = light.map(|light| light / weight);
        let of_mean = outer(mean);
        Self { mean, covariance: std::array::from_fn(|k| squares[k] / weight - of_mean[k]) }
    }
}

/// The colours around a mixed pixel.
struct Surfaces {
    near: Color,
    far: Color,
    /// What the near surface has at edges, and how far that counts, 0 to 1.
    fringe: Option<(Color, f32)>,
}

/// What clusters are made of.
pub(super) struct View<'a> {
    /// Columns and rows.
    pub size: (usize, usize),
    /// Depth of all pixels, in metres; one surface's inverse depths differ by no more than `jump`, in 1/m.
    pub metres: &'a [f32],
    pub jump: f32,
    /// Pixels that may be mixed.
    pub at_edge: &'a Bits,
    /// 8-bit sRGB, and the light of each code.
    pub rgb: &'a [u8],
    pub light: &'a [f32; 256],
}

impl View<'_> {
    /// Inverse depth of a pixel, in 1/m; 0 where it is unknown.
    #[inline(always)]
    pub fn inverse(&self, at: usize) -> f32 {
        DepthMap::inverse_of(self.metres[at])
    }

    /// The colour of a pixel in linear light.
    #[inline(always)]
    pub fn light(&self, at: usize) -> [f32; 3] {
        light_of(self.light, self.rgb, at)
    }
}

/// The contrast of the colours of two surfaces. What `fringe` has, the pixels at edges that the map gives to the near one, is
/// mostly that surface. If its colour says otherwise, the near surface has other colours here than where its pixels are
/// pure, as hair beside a face has: then it has those of the fringe, less the far surface that is mixed in.
#[inline(always)]
fn contrast(Surfaces { near, far, fringe }: Surfaces) -> Contrast {
    let pure = Contrast::of([near, far]);
    let Some((fringe, weight)) = fringe else { return pure };
    let other =
        weight * ((FRINGE_SHARES[1] - pure.share(fringe.mean)) / (FRINGE_SHARES[1] - FRINGE_SHARES[0])).clamp(0.0, 1.0);
    if other <= 0.0 {
        return pure;
    }
    let own = |p: usize| (far.mean[p] + (fringe.mean[p] - far.mean[p]) / FRINGE_SHARE).clamp(0.0, 1.0);
    let mean = std::array::from_fn(|p| near.mean[p] + other * (own(p) - near.mean[p]));
    let covariance = std::array::from_fn(|k| near.covariance[k] + other * (fringe.covariance[k] - near.covariance[k]));
    Contrast::of([Color { mean, covariance }, far])
}

/// Every other pixel of a cell, as on a chessboard, tells enough.
const SAMPLES: usize = CELL_PX * CELL_PX / 2;
/// Numbers of so many pixels.
type Lanes = [f32; SAMPLES];

/// Pixels of a cell: weight, position, inverse depth and light.
struct Samples {
    weight: Lanes,
    x: Lanes,
    y: Lanes,
    inverse: Lanes,
    light: [Lanes; 3],
}

impl Samples {
    /// The cluster of those that are chosen, with these weights.
    #[inline(always)]
    fn cluster(&self, weight: &Lanes) -> Cluster {
        let Self { x, y, inverse, light: [r, g, b], .. } = self;
        let (own_r, own_g, own_b) = (product(weight, r), product(weight, g), product(weight, b));
        let light = [total(&own_r), total(&own_g), total(&own_b)];
        let of_r = [total(&product(&own_r, r)), total(&product(&own_r, g)), total(&product(&own_r, b))];
        let others = [total(&product(&own_g, g)), total(&product(&own_g, b)), total(&product(&own_b, b))];
        let means = [total(&product(weight, x)), total(&product(weight, y)), total(&product(weight, inverse))];
        Cluster::of_sums(total(weight), light, (of_r, others), means)
    }
}

#[inline(always)]
fn product(a: &Lanes, b: &Lanes) -> Lanes {
    let mut products = [0.0; SAMPLES];
    for k in 0..SAMPLES {
        products[k] = a[k] * b[k];
    }
    products
}

/// The sum of all, in the same order on every processor.
#[inline(always)]
fn total(values: &Lanes) -> f32 {
    let mut quarters = [0.0; SAMPLES / 4];
    for k in 0..SAMPLES / 4 {
        let (a, b) = (values[k], values[k + SAMPLES / 4]);
        let (c, d) = (values[k + SAMPLES / 2], values[k + 3 * SAMPLES / 4]);
        quarters[k] = (a + b) + (c + d);
    }
    let [a, b, c, d, e, f, g, h] = quarters;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

/// The clusters of a cell: one where inverse depths differ by no more than `jump`, or else those of its nearest and of its
/// farthest surface.
#[inline(always)]
fn split(view: &View, column: usize, row: usize) -> [Cluster; 3] {
    let View { size: (width, height), jump, at_edge, .. } = *view;
    let (left, top) = (column * CELL_PX, row * CELL_PX);
    let (across, down) = ((width - left).min(CELL_PX), (height - top).min(CELL_PX));
    let (mut values, mut edges) = ([[0.0; CELL_PX]; CELL_PX], [0u32; CELL_PX]);
    let [(mut high, mut low), (mut pure_high, mut pure_low)] = [([0.0; CELL_PX], [f32::INFINITY; CELL_PX]); 2];
    for k in 0..down {
        let metres = &view.metres[(top + k) * width + left..][..across];
        for x in 0..across {
            values[k][x] = DepthMap::inverse_of(metres[x]);
        }
        // What is beyond the picture is as its last column, and at an edge.
        for x in across..CELL_PX {
            values[k][x] = values[k][across - 1];
        }
        edges[k] = (at_edge.from(left, top + k) as u32 & (1 << across) - 1) | !0 << across;
        for x in 0..CELL_PX {
            let (value, is_pure) = (values[k][x], edges[k] >> x & 1 == 0);
            (high[x], low[x]) = (larger(high[x], value), smaller(low[x], value));
            pure_high[x] = if is_pure { larger(pure_high[x], value) } else { pure_high[x] };
            pure_low[x] = if is_pure { smaller(pure_low[x], value) } else { pure_low[x] };
        }
    }
    let ends = |high: [f32; CELL_PX], low: [f32; CELL_PX]| {
        (high.into_iter().fold(0.0, larger), low.into_iter().fold(f32::INFINITY, smaller))
    };
    let (pure, all) = (ends(pure_high, pure_low), ends(high, low));
    let (high, low) = if pure.0 >= pure.1 { pure } else { all };
    let is_one = high - low <= jump;
    let tolerance = if is_one { 2.0 * jump } else { jump };
    let close = close_to_edge(view, left, top);
    let zeros = [0.0; SAMPLES];
    let mut samples = Samples { weight: zeros, x: zeros, y: zeros, inverse: zeros, light: [zeros; 3] };
    for k in 0..down {
        for (n, x) in (k % 2..across).step_by(2).enumerate() {
            let n = k * CELL_PX / 2 + n;
            let light = view.light((top + k) * width + left + x);
            for p in 0..3 {
                samples.light[p][n] = light[p];
            }
            (samples.x[n], samples.y[n], samples.inverse[n]) = ((left + x) as f32, (top + k) as f32, values[k][x]);
            let of_edge = (edges[k] >> x & 1, close[k] >> x & 1);
            samples.weight[n] = match of_edge {
                (0, 0) => 1.0,
                (0, _) => CLOSE_WEIGHT,
                _ => AT_EDGE_WEIGHT,
            };
        }
    }
    let mut weights = [zeros; 2];
    for n in 0..SAMPLES {
        let is_far = !is_one & (samples.inverse[n] <= 0.5 * (high + low));
        let off = (samples.inverse[n] - if is_far { low } else { high }).abs();
        let weight = if off > tolerance { 0.0 } else { samples.weight[n] };
        weights[0][n] = if is_far { 0.0 } else { weight };
        weights[1][n] = if is_far { weight } else { 0.0 };
    }
    let far = if is_one { Cluster::default() } else { samples.cluster(&weights[1]) };
    let mut clusters = [samples.cluster(&weights[0]), far, Cluster::default()];
    if all.0 - all.1 > jump {
        let fringe = &mut clusters[FRINGE];
        for k in 0..down {
            for x in places(u64::from(edges[k] & (1 << across) - 1)) {
                let value = values[k][x];
                if value > 0.5 * (all.0 + all.1) {
                    let light = view.light((top + k) * width + left + x);
                    let ([r, g, b], [rr, rg, rb, gg, gb, bb]) = (light, outer(light));
                    fringe.sums.add(1.0, &Sums([1.0, r, g, b, rr, rg, rb, gg, gb, bb, 0.0, 0.0]));
                    fringe.x += (left + x) as f32;
                    fringe.y += (top + k) as f32;
                    fringe.inverse += value;
                }
            }
        }
        if fringe.sums.weight() > 0.0 {
            let scale = 1.0 / fringe.sums.weight();
            (fringe.x, fringe.y, fringe.inverse) = (scale * fringe.x, scale * fringe.y, scale * fringe.inverse);
        }
    }
    clusters
}

/// Which pixels of the rows of a cell are at an edge or close to one, a bit for each.
#[inline(always)]
fn close_to_edge(view: &View, left: usize, top: usize) -> [u32; CELL_PX] {
    let mut rows = [0u32; CELL_PX + 2 * CLOSE_PX];
    for (k, row) in rows.iter_mut().enumerate() {
        let Some(y) = (top + k).checked_sub(CLOSE_PX).filter(|&y| y < view.size.1) else { continue };
        let first = left.saturating_sub(CLOSE_PX);
        let edges = (view.at_edge.from(first, y) as u32) << (first + CLOSE_PX - left);
        // The bit of column `left` of the cell is that of its first `2 CLOSE_PX + 1` columns.
        *row = (0..=2 * CLOSE_PX).fold(0, |close, by| close | edges >> by);
    }
    std::array::from_fn(|k| rows[k..=k + 2 * CLOSE_PX].iter().fold(0, |close, row| close | row))
}
