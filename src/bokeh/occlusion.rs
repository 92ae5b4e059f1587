//! What near bins hide from those behind them: layers of bins, and what each has to have filled in.
//!
//! Light from behind a near thing passes its blurred rim, so every layer needs what the layers in front of it hide. Where
//! one surface goes through several layers, as the ground does, nothing is hidden but its own continuation, which the
//! bins share without a fill.

use std::ops::Range;

use super::plan::{HAND_OVER, Plan, Share};

/// Into so many layers near bins are divided: each is filled for itself, which takes time.
const MOST_NEAR_LAYERS: usize = 2;
/// Those, and that of all other bins.
pub const MOST_LAYERS: usize = MOST_NEAR_LAYERS + 1;

/// A step of the CoC to what lies behind, as a share of a near pixel's own, at which that begins to be another surface, and
/// at which it is one.
pub const OTHER_FROM: f32 = 0.35;
pub const OTHER_TO: f32 = 0.6;
/// What has this many times the CoC of the near bins' border, or more, hides what is behind it.
const HIDDEN_FROM: f32 = 1.5;

impl Plan {
    /// The bins of each layer, front to back: near bins, in at most [`MOST_NEAR_LAYERS`] groups, and all others. What the
    /// layers in front hide is filled in for each: see [`Self::unhidden`].
    pub fn layers(&self) -> impl Iterator<Item = Range<usize>> + use<> {
        let (near, all) = (self.bins.iter().filter(|bin| bin.near).count(), self.bins.len());
        let groups = near.min(MOST_NEAR_LAYERS);
        let in_front = (0..groups).map(move |k| k * near / groups..(k + 1) * near / groups);
        in_front.chain(std::iter::once(near..all))
    }

    /// The signed CoC, <= 0, from which on the bins before `first` take no share: what is filled in behind them is not
    /// below it.
    pub fn nearest_behind_px(&self, first: usize) -> f32 {
        first.checked_sub(1).map_or(f32::MIN, |front| self.bins[front].high_px * (1.0 - HAND_OVER))
    }

    /// How much of a pixel the layer of bins from `first` on takes as it is; the rest counts as hidden by the near bins
    /// before it and is filled in, as far as what lies behind is another surface ([`other_surface`]).
    pub fn unhidden(&self, first: usize) -> Share {
        let border_px = first.checked_sub(1).map(|front| self.bins[front].high_px);
        Share::new(
            border_px.map(|at_px| (at_px * (0.5 + 0.5 * HIDDEN_FROM), 1.0 / ((1.0 - HIDDEN_FROM) * at_px))),
            None,
        )
    }
}

/// How far what is filled in behind a pixel is another surface, 0 to 1, told by their CoC. A surface that comes nearer, such
/// as the ground, hides its own continuation, which looks like it.
#[inline(always)]
pub fn other_surface(own_px: f32, behind_px: f32) -> f32 {
    let step = (own_px - behind_px) / own_px.min(-1e-3);
    ((step - OTHER_FROM) / (OTHER_TO - OTHER_FROM)).clamp(0.0, 1.0)
}
