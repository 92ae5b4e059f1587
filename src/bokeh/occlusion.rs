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

/// Pixels a side of a cell of the grid that silhouettes are noted in.
pub const GRAIN: usize = 4;
/// What is noted of a silhouette: the distances of [`Silhouette`].
pub const SHOWS: usize = 3;
/// Pixels that a distance is larger by, as the grid is coarse and linear between its cells. No whole number: the executors, which
/// round otherwise, are to agree where radii are whole ones.
pub const MARGIN_PX: f32 = 2.0 * GRAIN as f32 + 0.3;
/// What can be seen past a silhouette ends at its radius `r`; from where `r^2` less the squared distance is this share of `r^2`,
/// it is faded out, so that nothing ends at once. Past a straight edge 5 % of the aperture see beyond it there.
pub const FADE: f32 = 0.36;
/// With less coverage than this, a surface does not fill a pixel.
pub const OWN_COVERAGE: f32 = 0.05;

/// A jump of the CoC between two neighbours: the edge of the nearer surface, and how far from it what lies behind matters, in
/// pixels; -1 where not at all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Silhouette {
    /// So far anything farther can be seen through the aperture: the radius of the nearer surface.
    pub shows_px: f32,
    /// The same where what is farther does not lie in front of the subject.
    pub shows_back_px: f32,
    /// So far what is hidden can matter: what is seen is blurred itself.
    pub uncovers_px: f32,
}

/// What has a CoC above this does not lie in front of the subject, for a layer in front begins at such a radius.
#[inline(always)]
pub fn front_px(near_from_px: f32) -> f32 {
    -(1.0 + HAND_OVER) * near_from_px
}

/// By how much a step to what is farther is larger than a surface that goes on would make ([`OTHER_FROM`]), and than `least_px`.
#[inline(always)]
pub fn beyond_px(near_px: f32, far_px: f32, least_px: f32) -> f32 {
    let most_px = OTHER_FROM * near_px.abs();
    far_px - near_px - if most_px > least_px { most_px } else { least_px }
}

/// Directions in which what hides is looked past, as steps across and down (the other side of each is looked at, too). What is
/// known at both ends of a line through a hidden pixel, and alike, tells what is in between: so straight outlines run on behind
/// what hides them, where a mean of all around would end them there. After the idea that inpainting carries on isophotes
/// (Bertalmio et al., *Image Inpainting*, SIGGRAPH 2000, section 3), with surfaces told apart by their CoC.
pub const DIRECTIONS: [(i32, i32); 8] = [(1, 0), (2, 1), (1, 1), (1, 2), (0, 1), (-1, 2), (-1, 1), (-2, 1)];
/// Farther than this many steps nobody looks.
pub const MOST_STEPS: u8 = 254;
/// Where CoC are this far apart, two surfaces are half alike.
pub const HALF_ALIKE_PX: f32 = 2.0;
/// Where all that is seen from a pixel has CoC less apart than this, it is one surface, of which a mean of all around is as good.
pub const ONE_SURFACE_PX: f32 = 1.0;
/// Up to so many steps from end to end a line is trusted wholly, and from twice as many on not at all: deep within something
/// large, lines from far away cross one another, and a mean of all around has no edges of its own.
pub const TRUSTED_STEPS: f32 = 12.0;
/// A line with one end counts as one with two alike ends would that is so many times as long.
pub const ONE_ENDED: f32 = 4.0;

/// How alike two surfaces are by their CoC: 1 where they are the same, 0 where they are far apart.
#[inline(always)]
pub fn likeness(a_px: f32, b_px: f32) -> f32 {
    let apart = (a_px - b_px) * (1.0 / HALF_ALIKE_PX);
    1.0 / (1.0 + apart * apart)
}

impl Silhouette {
    /// That between two pixels of these CoC, where it is one: a step of `least_px`, which is also more than a surface that goes
    /// on would make ([`OTHER_FROM`]): coarse codes of depth are no silhouettes. From `near_from_px` on, a radius in front of the
    /// focal plane is that of a layer in front.
    #[inline(always)]
    pub fn between(a_px: f32, b_px: f32, least_px: f32, near_from_px: f32) -> Option<Self> {
        let (near_px, far_px) = (a_px.min(b_px), a_px.max(b_px));
        let shows_px = near_px.abs() + MARGIN_PX;
        let shows_back_px = if far_px > front_px(near_from_px) { shows_px } else { -1.0 };
        (beyond_px(near_px, far_px, least_px) >= 0.0).then_some(Self {
            shows_px,
            shows_back_px,
            uncovers_px: shows_px + far_px.abs(),
        })
    }
}

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

    /// Where what lies in front of the subject ends: the CoC of the last near bin's border, and the slope of the hand-over; a
    /// border that all lies behind without such bins.
    pub fn near_to(&self) -> (f32, f32) {
        let last = self.bins.iter().rposition(|bin| bin.near);
        last.and_then(|last| self.border(last)).unwrap_or((-1e30, 1.0))
    }

    /// The CoC above which no bin that holds anything of a surface in front begins: that of the far border of the bin in focus.
    pub fn kin_to_px(&self) -> f32 {
        let focus = self.bins.iter().position(|bin| !bin.near);
        focus.map_or(f32::MAX, |focus| self.bins[focus].high_px * (1.0 + HAND_OVER))
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
