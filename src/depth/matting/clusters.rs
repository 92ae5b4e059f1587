//! Colour models of surfaces from clusters: each square cell of pixels has one cluster per surface, at most two.
//!
//! Around a mixed pixel, the means and covariances of both surfaces' colours are needed, close by where there are pure
//! pixels, and from further away where there are none, as in hair. Cells provide both in a tenth of the time of single
//! pixels.

mod cell;
mod color_models;

use super::contrast::{Color, Contrast};
use super::linear_light;
use crate::depth::bitmap::Bitmap;

pub(super) use cell::{AT_EDGE_WEIGHT, CLOSE_PX, CLOSE_WEIGHT};
pub(super) use color_models::Clusters;
pub(super) use color_models::{FALLOFF_PX, FRINGE_PIXELS, RADII_CELLS};

/// Side of a cell, in pixels.
pub(super) const CELL_PX: usize = 8;

/// Index of the fringe cluster (edge pixels of the near surface), after those of the near and the far surface.
const FRINGE: usize = 2;
/// Average coverage by the near surface of the edge pixels that the map assigns to it.
pub(super) const FRINGE_ALPHA: f32 = 0.75;
/// Alphas of the fringe's mean colour, relative to the pure surfaces: below the first, it is another colour than the
/// near surface's; above the second, it is the same one.
pub(super) const FRINGE_ALPHAS: [f32; 2] = [-0.1, 0.25];

/// Weighted pixels of one surface in a cell.
#[derive(Clone, Copy, Debug, Default)]
struct Cluster {
    sums: Sums,
    /// Weighted means of position, in pixels, and of inverse depth, in 1/m.
    x: f32,
    y: f32,
    inverse: f32,
}

impl Cluster {
    /// Creates a cluster from colour sums, and the weighted sums of columns, rows (relative to the cell's corner) and
    /// inverse depths.
    #[inline(always)]
    fn new(sums: Sums, [x, y, inverse]: [f32; 3], (left, top): (usize, usize)) -> Self {
        if sums.weight() <= 0.0 {
            return Self::default();
        }
        let scale = 1.0 / sums.weight();
        Self { sums, x: left as f32 + scale * x, y: top as f32 + scale * y, inverse: scale * inverse }
    }
}

/// Weighted sums over pixels: weight, light (3), and products of light (6); padded from ten to whole vectors.
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
        Color::from_sums(weight, [x, y, z], [xx, xy, xz, yy, yz, zz])
    }

    #[inline(always)]
    fn add(&mut self, weight: f32, other: &Self) {
        for k in 0..self.0.len() {
            self.0[k] += weight * other.0[k];
        }
    }
}

/// Colours of both surfaces around a mixed pixel.
struct Surfaces {
    near: Color,
    far: Color,
    /// Colour of the near surface's edge pixels, and its confidence, 0 to 1.
    fringe: Option<(Color, f32)>,
}

/// The input of clustering.
pub(super) struct FrameView<'a> {
    /// Columns and rows.
    pub size: (usize, usize),
    /// Depth of all pixels, in metres; inverse depths of one surface differ by at most `depth_step`, in 1/m.
    pub metres: &'a [f32],
    pub depth_step: f32,
    /// Pixels beside depth discontinuities, which may be mixed.
    pub at_edge: &'a Bitmap,
    /// 8-bit sRGB, and the linear light of each code.
    pub rgb: &'a [u8],
    pub light: &'a [f32; 256],
}

impl FrameView<'_> {
    /// Returns the linear light of a pixel.
    #[inline(always)]
    pub fn light(&self, at: usize) -> [f32; 3] {
        linear_light(self.light, self.rgb, at)
    }
}

/// Computes the colour contrast of two surfaces. The fringe (edge pixels that the map assigns to the near surface)
/// mostly shows that surface. If its colour differs from the pure pixels', such as hair beside a face, the near surface
/// gets the fringe's colour, with the far surface's part removed.
#[inline(always)]
fn compute_contrast(Surfaces { near, far, fringe }: Surfaces) -> Contrast {
    let pure = Contrast::new([near, far]);
    let Some((fringe, weight)) = fringe else { return pure };
    let other =
        weight * ((FRINGE_ALPHAS[1] - pure.alpha(fringe.mean)) / (FRINGE_ALPHAS[1] - FRINGE_ALPHAS[0])).clamp(0.0, 1.0);
    if other <= 0.0 {
        return pure;
    }
    let own = |p: usize| (far.mean[p] + (fringe.mean[p] - far.mean[p]) / FRINGE_ALPHA).clamp(0.0, 1.0);
    let mean = std::array::from_fn(|p| near.mean[p] + other * (own(p) - near.mean[p]));
    let covariance = std::array::from_fn(|k| near.covariance[k] + other * (fringe.covariance[k] - near.covariance[k]));
    Contrast::new([Color { mean, covariance }, far])
}
