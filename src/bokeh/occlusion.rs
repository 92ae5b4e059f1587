//! Occlusion: layers of bins, and the inpainting each layer needs.
//!
//! The blurred rim of a near object is semi-transparent, so every layer needs the background that the layers in front
//! of it occlude. Where one surface spans several layers, as the ground does, it occludes only its own continuation,
//! which the bins share without inpainting.

use std::ops::Range;

use super::plan::{BinWeight, Plan};
use super::split::CROSS_FADE;

/// Largest number of layers of near bins; each is inpainted separately, which takes time.
const MAX_NEAR_LAYERS: usize = 2;
/// Largest number of layers: the near ones and the layer of all other bins.
pub const MAX_LAYERS: usize = MAX_NEAR_LAYERS + 1;

/// CoC step to the surface behind, as a fraction of a near pixel's own CoC: below `OTHER_SURFACE_FROM` it is the same
/// surface, from `OTHER_SURFACE_TO` on a different one.
pub const OTHER_SURFACE_FROM: f32 = 0.35;
pub const OTHER_SURFACE_TO: f32 = 0.6;
/// A pixel whose CoC is at least this many times that of the near bins' border is replaced entirely.
const FULLY_HIDDEN_FROM: f32 = 1.5;

/// Side of a cell of the grid of silhouettes, in pixels.
pub const SILHOUETTE_CELL: usize = 4;
/// Number of distances stored per cell, see [`silhouette_between`].
pub const DISTANCES_PER_CELL: usize = 3;
/// Margin added to each distance, in pixels, because the grid is coarse and interpolated linearly. Not a whole number,
/// so that both executors, which round differently, agree at whole radii.
pub const MARGIN_PX: f32 = 2.0 * SILHOUETTE_CELL as f32 + 0.3;
/// Past a silhouette, the background is visible within its radius `r`. It fades out where `r^2` minus the squared
/// distance is below this fraction of `r^2`, which avoids a hard edge. At that distance 5 % of the aperture sees past a
/// straight edge.
pub const FADE_FRACTION: f32 = 0.36;
/// A surface with less coverage than this does not fill a pixel.
pub const MIN_OWN_COVERAGE: f32 = 0.05;

/// Returns the CoC above which a pixel is not in front of the subject: layers in front begin at this radius.
#[inline(always)]
pub fn front_px(near_from_px: f32) -> f32 {
    -(1.0 + CROSS_FADE) * near_from_px
}

/// Returns by how much the step to a farther CoC exceeds the step within a continuous surface ([`OTHER_SURFACE_FROM`])
/// and `min_step_px`.
#[inline(always)]
pub fn excess_step_px(near_px: f32, far_px: f32, min_step_px: f32) -> f32 {
    let surface_step_px = OTHER_SURFACE_FROM * near_px.abs();
    far_px - near_px - if surface_step_px > min_step_px { surface_step_px } else { min_step_px }
}

/// Returns the distances from the silhouette between two pixels with these CoC, in pixels, -1 if nowhere: up to where
/// anything farther is visible through the aperture, which is the radius of the nearer surface; the same if the farther
/// surface is not in front of the subject; up to where the hidden background matters, as it is itself blurred. There is
/// a silhouette if the step is at least `min_step_px` and larger than that of a continuous surface
/// ([`OTHER_SURFACE_FROM`]): quantisation of depth is no silhouette. Layers in front begin at the radius `near_from_px`.
#[inline(always)]
pub fn silhouette_between(a_px: f32, b_px: f32, min_step_px: f32, near_from_px: f32) -> [f32; DISTANCES_PER_CELL] {
    let (near_px, far_px) = if a_px < b_px { (a_px, b_px) } else { (b_px, a_px) };
    let is_one = excess_step_px(near_px, far_px, min_step_px) >= 0.0;
    let visible_px = if is_one { near_px.abs() + MARGIN_PX } else { -1.0 };
    let background_visible_px = if far_px > front_px(near_from_px) { visible_px } else { -1.0 };
    [visible_px, background_visible_px, if is_one { visible_px + far_px.abs() } else { -1.0 }]
}

impl Plan {
    /// Returns the bins of each layer, front to back: near bins in at most [`MAX_NEAR_LAYERS`] groups, then all
    /// others. Each layer is inpainted where the layers in front occlude it: see [`Self::visible_weight`].
    pub fn layers(&self) -> impl Iterator<Item = Range<usize>> + use<> {
        let (near, all) = (self.bins.iter().filter(|bin| bin.near).count(), self.bins.len());
        let groups = near.min(MAX_NEAR_LAYERS);
        let in_front = (0..groups).map(move |k| k * near / groups..(k + 1) * near / groups);
        in_front.chain(std::iter::once(near..all))
    }

    /// Returns the signed CoC (<= 0) above which the bins before `first` have weight 0: inpainted CoC are clamped to
    /// it.
    pub fn min_inpainted_px(&self, first: usize) -> f32 {
        first.checked_sub(1).map_or(f32::MIN, |front| self.bins[front].high_px * (1.0 - CROSS_FADE))
    }

    /// Returns the far end of the region in front of the subject: CoC of the last near bin's border, and slope of the
    /// cross-fade. Without near bins, a border in front of everything.
    pub fn near_border(&self) -> (f32, f32) {
        let last = self.bins.iter().rposition(|bin| bin.near);
        last.and_then(|last| self.border(last)).unwrap_or((-1e30, 1.0))
    }

    /// Returns the CoC above which no bin that may contain part of a surface in front begins: the far border of the bin
    /// in focus.
    pub fn focus_border_px(&self) -> f32 {
        let focus = self.bins.iter().position(|bin| !bin.near);
        focus.map_or(f32::MAX, |focus| self.bins[focus].high_px * (1.0 + CROSS_FADE))
    }

    /// Returns the weight of a pixel's own content in the layer of bins from `first` on. The rest is occluded by the
    /// near bins before it and is inpainted, if the background is a different surface ([`other_surface_likelihood`]).
    pub fn visible_weight(&self, first: usize) -> BinWeight {
        let border_px = first.checked_sub(1).map(|front| self.bins[front].high_px);
        BinWeight::new(
            border_px.map(|at_px| (at_px * (0.5 + 0.5 * FULLY_HIDDEN_FROM), 1.0 / ((1.0 - FULLY_HIDDEN_FROM) * at_px))),
            None,
        )
    }
}

/// Returns how likely the inpainted background is a different surface, 0 to 1, judged by CoC. A surface that comes
/// nearer, such as the ground, hides its own continuation, which looks like it.
#[inline(always)]
pub fn other_surface_likelihood(own_px: f32, behind_px: f32) -> f32 {
    let step = (own_px - behind_px) / own_px.min(-1e-3);
    ((step - OTHER_SURFACE_FROM) / (OTHER_SURFACE_TO - OTHER_SURFACE_FROM)).clamp(0.0, 1.0)
}
