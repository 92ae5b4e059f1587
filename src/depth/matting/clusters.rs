//! The colours of surfaces, in clusters: a square cell of pixels has one of each surface that it shows, at most two.
//!
//! What is wanted around a mixed pixel are means and covariances of both surfaces, close by where there are pure pixels
//! and from some way off where there are none, as in hair. Cells have both for a tenth of the time that pixels need.

mod answers;

use super::share::Contrast;
use super::symmetric::{Symmetric, outer};
use super::{larger, light_of, smaller};
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

/// Pixels of one surface in a cell, weighted: sums, but for the means of position and inverse depth.
#[derive(Clone, Copy, Debug, Default)]
struct Cluster {
    weight: f32,
    x: f32,
    y: f32,
    inverse: f32,
    light: [f32; 3],
    squares: Symmetric,
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
    pub at_edge: &'a [bool],
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

impl Cluster {
    #[inline(always)]
    fn add(&mut self, weight: f32, (x, y): (usize, usize), inverse: f32, light: [f32; 3]) {
        self.weight += weight;
        self.x += weight * x as f32;
        self.y += weight * y as f32;
        self.inverse += weight * inverse;
        for (sum, light) in self.light.iter_mut().zip(light) {
            *sum += weight * light;
        }
        for (sum, square) in self.squares.iter_mut().zip(outer(light)) {
            *sum += weight * square;
        }
    }

    #[inline(always)]
    fn color(&self) -> Color {
        Color::of_sums(self.weight, self.light, self.squares)
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

/// The clusters of a cell: one where inverse depths differ by no more than `jump`, or else those of its nearest and of its
/// farthest surface.
#[inline(always)]
fn split(view: &View, column: usize, row: usize) -> [Cluster; 3] {
    let View { size: (width, height), jump, at_edge, .. } = *view;
    let (xs, ys) =
        (column * CELL_PX..((column + 1) * CELL_PX).min(width), row * CELL_PX..((row + 1) * CELL_PX).min(height));
    let [mut pure, mut all] = [(0.0f32, f32::INFINITY); 2];
    let mut values = [[0.0; CELL_PX]; CELL_PX];
    for (values, y) in values.iter_mut().zip(ys.clone()) {
        let row = y * width + xs.start..y * width + xs.end;
        for ((value, &metres), &at_edge) in values.iter_mut().zip(&view.metres[row.clone()]).zip(&at_edge[row]) {
            *value = DepthMap::inverse_of(metres);
            all = (larger(all.0, *value), smaller(all.1, *value));
            let (most, least) = (larger(pure.0, *value), smaller(pure.1, *value));
            pure = if at_edge { pure } else { (most, least) };
        }
    }
    let value_at = |x: usize, y: usize| values[y - ys.start][x - xs.start];
    let (high, low) = if pure.0 >= pure.1 { pure } else { all };
    let one = high - low <= jump;
    let tolerance = if one { 2.0 * jump } else { jump };
    let mut clusters = [Cluster::default(); 3];
    let close = close_to_edge(view, xs.start, ys.start);
    for (y, close) in ys.clone().zip(close) {
        // Every other pixel, as on a chessboard, tells enough.
        for x in (xs.start + y % 2..xs.end).step_by(2) {
            let (at, value) = (y * width + x, value_at(x, y));
            let far = usize::from(!one && value <= 0.5 * (high + low));
            if (value - [high, low][far]).abs() > tolerance {
                continue;
            }
            let weight = match close >> (x - xs.start) & 1 {
                _ if at_edge[at] => AT_EDGE_WEIGHT,
                0 => 1.0,
                _ => CLOSE_WEIGHT,
            };
            clusters[far].add(weight, (x, y), value, view.light(at));
        }
    }
    if all.0 - all.1 > jump {
        for (x, y) in ys.clone().flat_map(|y| xs.clone().map(move |x| (x, y))) {
            let at = y * width + x;
            if at_edge[at] && value_at(x, y) > 0.5 * (all.0 + all.1) {
                clusters[FRINGE].add(1.0, (x, y), value_at(x, y), view.light(at));
            }
        }
    }
    for cluster in clusters.iter_mut().filter(|cluster| cluster.weight > 0.0) {
        let scale = 1.0 / cluster.weight;
        (cluster.x, cluster.y, cluster.inverse) = (scale * cluster.x, scale * cluster.y, scale * cluster.inverse);
    }
    clusters
}

/// Which pixels of the rows of a cell are at an edge or close to one, a bit for each.
#[inline(always)]
fn close_to_edge(view: &View, left: usize, top: usize) -> [u32; CELL_PX] {
    let (width, height) = view.size;
    let mut rows = [0u32; CELL_PX + 2 * CLOSE_PX];
    for (k, row) in rows.iter_mut().enumerate() {
        let Some(y) = (top + k).checked_sub(CLOSE_PX).filter(|&y| y < height) else { continue };
        let columns = left.saturating_sub(CLOSE_PX)..(left + CELL_PX + CLOSE_PX).min(width);
        let shift = columns.start + CLOSE_PX - left;
        let bits = view.at_edge[y * width + columns.start..y * width + columns.end].iter().enumerate();
        let edges = bits.fold(0, |bits, (x, &at_edge)| bits | u32::from(at_edge) << (x + shift));
        // The bit of column `left` of the cell is that of its first `2 CLOSE_PX + 1` columns.
        *row = (0..=2 * CLOSE_PX).fold(0, |close, by| close | edges >> by);
    }
    std::array::from_fn(|k| rows[k..=k + 2 * CLOSE_PX].iter().fold(0, |close, row| close | row))
}
