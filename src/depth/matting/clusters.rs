//! The colours of surfaces, in clusters: a square cell of pixels has one of each surface that it shows, at most two.
//!
//! What is wanted around a mixed pixel are means and covariances of both surfaces, close by where there are pure pixels
//! and from some way off where there are none, as in hair. Cells have both for a tenth of the time that pixels need.

mod answers;
mod cell;

use super::contrast::Contrast;
use super::light_of;
use super::symmetric::{Symmetric, outer};
use crate::depth::bits::Bits;

pub(super) use answers::Clusters;
#[cfg(feature = "gpu")]
pub(super) use answers::{FRINGE_PIXELS, HALF_PX, REACHES_CELLS};
#[cfg(feature = "gpu")]
pub(super) use cell::{AT_EDGE_WEIGHT, CLOSE_PX, CLOSE_WEIGHT};

/// Side of a cell, in pixels.
pub(super) const CELL_PX: usize = 8;

/// The place of the cluster of the near surface's pixels at edges, after those of the near and the far surface.
const FRINGE: usize = 2;
/// So much of a pixel at an edge that the map gives to the near surface is that, on average.
pub(super) const FRINGE_SHARE: f32 = 0.75;
/// From the first share down, the colour of such pixels is not that of the near surface; from the second up, it is.
pub(super) const FRINGE_SHARES: [f32; 2] = [-0.1, 0.25];

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
    /// Of the sums of pixels, and of their columns and rows in a cell and their inverse depths, with their weights.
    #[inline(always)]
    fn new(sums: Sums, [x, y, inverse]: [f32; 3], (left, top): (usize, usize)) -> Self {
        if sums.weight() <= 0.0 {
            return Self::default();
        }
        let scale = 1.0 / sums.weight();
        Self { sums, x: left as f32 + scale * x, y: top as f32 + scale * y, inverse: scale * inverse }
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

    /// Adds a weight of another, in a weighted sum.
    #[inline(always)]
    pub(super) fn add(&mut self, weight: f32, other: &Self) {
        self.mean.iter_mut().zip(other.mean).for_each(|(sum, value)| *sum += weight * value);
        self.covariance.iter_mut().zip(other.covariance).for_each(|(sum, value)| *sum += weight * value);
    }

    #[inline(always)]
    pub(super) fn scaled(self, scale: f32) -> Self {
        Self { mean: self.mean.map(|value| scale * value), covariance: self.covariance.map(|value| scale * value) }
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
