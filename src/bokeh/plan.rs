//! The plan: which bins a picture is split into, at which scale each is filtered, and with which filters.
//!
//! Filters and memory are fixed per picture size and settings; the quality may change from frame to frame where the
//! settings are adaptive ([`Plan::set_quality`]), and the bins follow each frame's depth ([`Plan::split`]).
//! Both executors run a frame pass by pass, under these names (the CPU's `bin` unpacks the picture itself):
//!
//! 1. `unpack`: 8-bit sRGB to linear light with highlights expanded; depth to signed CoC.
//! 2. `bin`: every bin's share of each pixel, premultiplied, averaged down to the bin's scale.
//! 3. `fill` (only with something in front): what near objects hide is filled in before the bins behind are taken.
//! 4. `reach`: on a coarse grid, the local radius of each bin's content, and the range of its colours.
//! 5. `blur`: per bin a horizontal and a vertical low-rank pass with the local radius.
//! 6. `composite`: front to back as disjoint coverage, what stays open to the hindmost; back to 8-bit sRGB.

use std::sync::Arc;

use super::bank::Bank;
use super::ladder::{Compositing, Ladder};
use super::rung::{FOCUS_BORDER_PX, MOST_FULL_RADIUS_PX, Rung, scale_within};
pub use super::share::Share;
use super::split::{Counts, MAX_PIECES, Piece};
use super::{Method, Rank, Settings};
use crate::budget::Quality;
use crate::frame::{DepthMap, Matte};
use crate::optics::{CocField, CocKind};

/// Bin pixels a side of a cell of the coarse grid.
pub const CELL: usize = 8;
/// Bin pixels between two places where the radius is read; it is linear between them.
pub const SEGMENT: usize = 16;
/// Up to this many bins, so that both executors can hold them in fixed arrays.
pub const MAX_BINS: usize = 13;
/// A bin pixel with less coverage than this has no colour of its own.
pub const COVERAGE_FLOOR: f32 = 1e-3;

/// A bin that takes this share of a nearer surface, or more, shows nothing of what that hides.
pub const HIDING_SHARE: f32 = 0.25;

/// From this coverage on, a bin counts fully when the colour of the hindmost is worked out.
pub const HINDMOST_COVERAGE: f32 = 0.8;

/// No colour is brighter: a range that cuts nothing, for bins whose filters do not overshoot.
pub const ANY_COLOR: f32 = 1e20;

/// The least weight, along an axis, of a cell within reach in a local radius, which so exists wherever a filter finds
/// anything.
pub const FAR_WEIGHT: f32 = 0.02;

/// A range of signed CoC, and how it is filtered.
#[derive(Clone, Debug, PartialEq)]
pub struct Bin {
    /// Lower border of the CoC, pixels of the picture; `-inf` for the first.
    pub low_px: f32,
    pub high_px: f32,
    /// A bin pixel covers `scale` x `scale` pixels of the picture: one of [`super::rung::SCALES`].
    pub scale: usize,
    /// Columns of the bin's picture.
    pub width: usize,
    pub height: usize,
    /// Largest radius of its content, in bin pixels, already compensated.
    pub max_radius_px: f32,
    /// Whether it lies in front of the focal plane.
    pub near: bool,
    /// Which of the executor's memories it uses: the same one from frame to frame.
    pub slot: usize,
}

impl Bin {
    /// Width of the neighbourhood that a local radius is the mean of, in cells.
    pub fn sigma_cells(&self) -> f32 {
        (self.max_radius_px / (2.0 * CELL as f32)).max(0.5)
    }
}

/// The plan of the frames of one size. What depends on a frame's depth is [`Plan::split`].
#[derive(Clone, Debug)]
pub struct Plan {
    /// Columns of the picture.
    pub width: usize,
    pub height: usize,
    /// How bins become a picture.
    pub compositing: Compositing,
    pub quality: Quality,
    pub rung: Rung,
    /// Every rung that the plan can be set to.
    pub ladder: Arc<Ladder>,
    /// Front to back: by ascending CoC.
    pub bins: Vec<Bin>,
    /// The filters, in units of bin pixels.
    pub bank: Arc<Bank>,
    /// Which of the ladder's banks that is.
    pub bank_index: usize,
    /// Highlight recovery: 1 + 1/M, or infinity when off.
    pub expansion: f32,
    /// Whether the rank is full and the method the paper's: an exact 2-D gather.
    pub exact: bool,
    coc: CocKind,
    /// Whether bins stay at full scale as far as [`MOST_FULL_RADIUS_PX`] allows.
    full_scale: bool,
    /// Largest radius in the bin in focus.
    focus_px: f32,
    /// Largest CoC radius behind the focal plane and in front of it.
    max_px: [f32; 2],
    counts: Counts,
    /// Behind the focal plane and in front of it, outwards.
    pieces: [Vec<Piece>; 2],
}

impl Plan {
    /// Plans frames of `width` x `height` pixels, at the settings' quality to begin with. Radii are cut to
    /// [`Settings::most_radius_px`].
    pub fn new(settings: &Settings, width: u32, height: u32) -> Self {
        let settings = &settings.within((width, height));
        let compositing = match (settings.coc, settings.method) {
            (CocKind::Depth, Method::Layered) => Compositing::Layers,
            (CocKind::Depth, Method::Gather) => Compositing::Gather,
            (CocKind::Uniform | CocKind::Ramp, _) => Compositing::Select,
        };
        let ladder = Arc::new(Ladder::new(settings, compositing));
        let level = ladder.nearest(settings.quality);
        let mut plan = Self {
            width: width as usize,
            height: height as usize,
            compositing,
            quality: level.quality,
            rung: level.rung,
            bins: Vec::with_capacity(MAX_BINS),
            bank: Arc::clone(&ladder.banks[level.bank]),
            bank_index: level.bank,
            expansion: 1.0 + 1.0 / settings.highlights.max(0.0),
            exact: compositing == Compositing::Gather && settings.rank == Some(Rank::Full),
            ladder,
            coc: settings.coc,
            full_scale: settings.rank == Some(Rank::Full),
            focus_px: settings.far_max_px.max(settings.near_max_px),
            max_px: [settings.far_max_px, settings.near_max_px],
            counts: Counts::default(),
            pieces: std::array::from_fn(|_| Vec::with_capacity(MAX_PIECES)),
        };
        plan.lay_out_pieces();
        plan
    }

    /// Plans the next frames at another quality, or the nearest that the settings allow. Allocates nothing.
    pub fn set_quality(&mut self, quality: Quality) {
        let level = self.ladder.nearest(quality);
        if level.quality == self.quality {
            return;
        }
        (self.quality, self.rung) = (level.quality, level.rung);
        self.bank_index = level.bank;
        self.bank = Arc::clone(&self.ladder.banks[level.bank]);
        self.lay_out_pieces();
    }

    /// The bins of a uniform radius or of a ramp; with depth there is one until [`Plan::split`] has seen a frame.
    fn lay_out_pieces(&mut self) {
        let [far_px, near_px] = self.max_px;
        let [far, near] = &mut self.pieces;
        far.clear();
        near.clear();
        self.focus_px = far_px.max(near_px);
        match self.coc {
            CocKind::Ramp => {
                far.extend(geometric_pieces(far_px, self.rung.bins_per_side));
                self.focus_px = far.first().map_or(self.focus_px, |piece| piece.border_px);
            }
            CocKind::Uniform => far.push(Piece { border_px: 0.0, low_px: far_px, high_px: far_px }),
            CocKind::Depth => {}
        }
        self.lay_out_bins();
    }

    /// Splits the CoC of a frame into bins where it follows depth and bins are layers; else they stay.
    pub fn split(&mut self, depth: Option<&DepthMap>, coc: &CocField) {
        if self.compositing != Compositing::Layers {
            return;
        }
        match (coc, depth) {
            (CocField::Depth(lens), Some(depth)) => self.counts.count(depth, lens),
            _ => self.counts = Counts::default(),
        }
        self.lay_out_layers();
    }

    /// As [`Plan::split`], by the radius of every pixel.
    pub fn split_radii(&mut self, coc_px: &[f32]) {
        if self.compositing == Compositing::Layers {
            self.counts.count_radii(coc_px, self.width);
            self.lay_out_layers();
        }
    }

    /// The radius in front of the focal plane below which all belongs to the bin in focus.
    pub fn near_from_px(&self) -> f32 {
        self.rung.near_from_px.max(self.rung.near_from_share * self.max_px[0])
    }

    fn lay_out_layers(&mut self) {
        let near_from_px = self.near_from_px();
        let sides = [false, true].into_iter().zip(&mut self.pieces);
        let inner_px = sides.map(|(near, pieces)| self.counts.pieces(near, &self.rung, near_from_px, pieces));
        self.focus_px = inner_px.fold(0.0, f32::max).min(self.max_px[0].max(self.max_px[1]));
        self.lay_out_bins();
    }

    /// Makes the bins of the current pieces, front to back. A bin always has the slot of its place, whatever the level:
    /// 0 in focus, then those behind, outwards, then those in front.
    fn lay_out_bins(&mut self) {
        let [far, near] = &self.pieces;
        let per_side = self.ladder.most_bins_per_side();
        let inner_px = |pieces: &[Piece]| pieces.first().map_or(f32::INFINITY, |piece| piece.border_px);
        let outer_px = |pieces: &[Piece], k: usize| pieces.get(k + 1).map_or(f32::INFINITY, |piece| piece.border_px);
        let bin = |(low_px, high_px): (f32, f32), content: (f32, f32), slot: usize| {
            let scale = match self.compositing {
                Compositing::Gather => 1,
                _ if self.full_scale => scale_within(content.1, MOST_FULL_RADIUS_PX),
                // One radius everywhere.
                Compositing::Select if content.0 == content.1 => self.rung.even_scale(content.0),
                _ => self.rung.scale(content.0, content.1),
            };
            Bin {
                low_px,
                high_px,
                scale,
                width: self.width.div_ceil(scale),
                height: self.height.div_ceil(scale),
                max_radius_px: compensated_radius_px(content.1, scale).min(self.bank.max_radius_px()),
                near: high_px < 0.0,
                slot,
            }
        };
        self.bins.clear();
        for (k, piece) in near.iter().enumerate().rev() {
            let content = (piece.low_px, piece.high_px.min(self.max_px[1]));
            self.bins.push(bin((-outer_px(near, k), -piece.border_px), content, 1 + per_side + k));
        }
        // A uniform radius, whose border is 0, leaves nothing in focus.
        if inner_px(far) > 0.0 {
            self.bins.push(bin((-inner_px(near), inner_px(far)), (0.0, self.focus_px), 0));
        }
        for (k, piece) in far.iter().enumerate() {
            let content = (piece.low_px, piece.high_px.min(self.max_px[0]));
            let low_px = if piece.border_px > 0.0 { piece.border_px } else { f32::NEG_INFINITY };
            self.bins.push(bin((low_px, outer_px(far, k)), content, 1 + k));
        }
    }

    /// Whether truncation makes a bin's filters overshoot visibly. Small filters keep nearly all of their terms: even
    /// ones have `reach + 1`, others `2 reach + 1`.
    pub fn has_lobes(&self, bin: &Bin) -> bool {
        let reach = self.bin_reach(bin);
        self.bank.terms < if self.bank.even { reach } else { 2 * reach }
    }

    /// The finest scale that a bin in this slot can have, at any level: far from focus, layers are always reduced.
    pub fn least_scale(&self, slot: usize) -> usize {
        let side = self.ladder.most_bins_per_side();
        let fine = slot == 0 || (slot - 1) % side.max(1) < self.ladder.most_fine_bins();
        if self.full_scale || fine || self.compositing != Compositing::Layers { 1 } else { 2 }
    }

    /// How many slots for bins an executor needs, whatever the level.
    pub fn slots(&self) -> usize {
        match self.coc {
            CocKind::Depth if self.compositing == Compositing::Gather => 1,
            CocKind::Depth => 1 + 2 * self.ladder.most_bins_per_side(),
            CocKind::Ramp if self.pieces[0].is_empty() => 1,
            CocKind::Ramp => 1 + self.ladder.most_bins_per_side(),
            // Its one bin is in slot 1.
            CocKind::Uniform => 2,
        }
    }

    /// The outermost tap of a bin's filters, in bin pixels.
    pub fn bin_reach(&self, bin: &Bin) -> usize {
        self.bank.node_reach[self.bank.node(bin.max_radius_px)] as usize
    }

    /// The index of the bin that uses a slot, in this frame.
    pub fn bin_in(&self, slot: usize) -> Option<usize> {
        self.bins.iter().position(|bin| bin.slot == slot)
    }

    /// How many cells away content can reach a cell, and the whole segment that its radius is read for.
    pub fn reach_cells(&self, bin: &Bin) -> usize {
        (self.bin_reach(bin) + SEGMENT).div_ceil(CELL)
    }

    /// Radius in bin pixels for a CoC radius in pixels of the picture.
    #[inline(always)]
    pub fn bin_radius_px(&self, bin: &Bin, coc_px: f32) -> f32 {
        compensated_radius_px(coc_px, bin.scale).min(bin.max_radius_px)
    }

    /// How much bin `index` takes of a pixel.
    pub fn share(&self, index: usize) -> Share {
        Share::new(index.checked_sub(1).and_then(|front| self.border(front)), self.border(index))
    }

    /// The mixed pixels of a frame that are taken apart: only layers can, and only with depth of the picture's size.
    pub fn matte<'a>(&self, depth: Option<&'a DepthMap>, coc: &CocField) -> Option<&'a Matte> {
        let map = depth.filter(|map| (map.width as usize, map.height as usize) == (self.width, self.height))?;
        let some = 1..=Matte::most(self.width, self.height);
        let apart = self.compositing == Compositing::Layers && matches!(coc, CocField::Depth(_));
        (apart && some.contains(&map.matte.pixels.len())).then_some(&map.matte)
    }

    /// The border between bin `index` and the one behind it: its CoC, and 1 over the width of the hand-over.
    pub fn border(&self, index: usize) -> Option<(f32, f32)> {
        let at = self.bins[index].high_px;
        at.is_finite().then(|| (at, 1.0 / (2.0 * HAND_OVER * at.abs())))
    }
}

/// Half the width of the hand-over between two bins, as a fraction of the border's CoC.
pub(super) const HAND_OVER: f32 = 0.15;

/// Splits the radii of a ramp into pieces of one ratio, as a blur's look goes with the ratio; none where the largest
/// radius is hardly above that of the bin in focus.
fn geometric_pieces(max_px: f32, bins: u32) -> impl Iterator<Item = Piece> {
    let ratio = max_px / FOCUS_BORDER_PX;
    let border_px = move |k: u32| FOCUS_BORDER_PX * ratio.powf(k as f32 / bins as f32);
    (0..if ratio > 1.3 { bins } else { 0 }).map(move |k| Piece {
        border_px: border_px(k),
        low_px: border_px(k),
        high_px: border_px(k + 1),
    })
}

/// The radius, in pixels of a picture reduced by `scale`, that blurs as much as `coc_px` does at full size.
///
/// The tents down and up add (2 s^2 + 1) / 12 of variance each, per axis in pixels of the picture, and larger pixels
/// (s^2 - 1) / 12; a disc of radius R has R^2 / 4. What the way down and up adds is taken off the radius.
#[inline(always)]
pub fn compensated_radius_px(coc_px: f32, scale: usize) -> f32 {
    if scale == 1 {
        return coc_px;
    }
    let s = scale as f32;
    (coc_px * coc_px - (5.0 * s * s + 1.0) / 3.0).max(0.0).sqrt() / s
}

#[cfg(test)]
mod tests;
