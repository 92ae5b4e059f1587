//! The plan: the bins that a picture is split into, and the scale and filters of each.
//!
//! Filters and memory are fixed per picture size and settings. The quality may change from frame to frame if the
//! settings are adaptive ([`Plan::set_quality`]); the bins follow each frame's depth ([`Plan::split_by_depth`]). Both
//! executors run a frame pass by pass, under these names (the CPU's `bin` unpacks the picture itself):
//!
//! 1. `unpack`: 8-bit sRGB to linear light with highlights expanded; depth to signed CoC.
//! 2. `bin`: each pixel times its weight in every bin, premultiplied, averaged down to the bin's scale.
//! 3. `fill` (only with something in front): inpaints what near objects occlude, before the bins behind them are made.
//! 4. `reach`: on a coarse grid, the local radius of each bin's content and the range of its colours.
//! 5. `decimate` (only with privacy, and where the bin's own pixels are finer): averages colours over larger cells.
//! 6. `blur`: per bin a horizontal and a vertical low-rank pass with the local radius.
//! 7. `composite`: front to back as disjoint coverage; the uncovered rest has the colour of the hindmost bin; back to
//!    8-bit sRGB.

mod band;
mod filters;
mod privacy;
mod slots;

use std::sync::Arc;

use band::BandRows;
use privacy::decimate;
pub use privacy::{CELL_SHARPNESS, min_private_radius_px};

use super::bank::{FilterBank, compensated_radius_px};
pub use super::bin_weight::BinWeight;
use super::ladder::{Compositing, QualityLadder};
use super::quality_level::{MAX_FULL_RADIUS_PX, NEAR_FROM_FRACTION, NEAR_FROM_PX, QualityLevel, SCALES, scale_within};
use super::split::{CROSS_FADE, CocHistogram, CocRange, MAX_RANGES, geometric_ranges};
use super::{Method, Rank, Settings};
use crate::budget::Quality;
use crate::frame::{DepthMap, Matte};
use crate::optics::{CocField, CocKind};

/// Side of a cell of the coarse grid, in bin pixels.
pub const CELL: usize = 8;
/// Bin pixels between two segment edges, where the radius is sampled; it is linear between them.
pub const SEGMENT: usize = 16;
/// Largest number of bins, so that both executors can use fixed arrays.
pub const MAX_BINS: usize = 11;
/// A bin pixel with less coverage than this has no colour of its own.
pub const MIN_COVERAGE: f32 = 1e-3;

/// A bin with at least this weight of a nearer surface shows nothing of the surface it occludes. What it shows at a smaller
/// weight is also where the nearer surface's own share of the bin is missed, up to a quarter of this.
pub const HIDING_WEIGHT: f32 = 0.02;

/// Coverage from which a bin counts fully when the colour of the hindmost bin is computed.
pub const HINDMOST_COVERAGE: f32 = 0.8;

/// Larger than any colour: a colour range that clamps nothing, for bins whose filters do not overshoot.
pub const UNBOUNDED_COLOR: f32 = 1e20;

/// Smallest weight, per axis, of a cell within the filter support in a local radius: a radius exists wherever a filter
/// finds content.
pub const MIN_CELL_WEIGHT: f32 = 0.02;

/// Up to this fraction of the picture may be blurred by more than [`SHARP_PX`](super::split::SHARP_PX) in a bin in focus
/// that is shown as it is.
const MAX_DEFOCUSED_FRACTION: f32 = 0.0005;

/// A range of signed CoC, with the scale of its picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Bin {
    /// Lower border of the CoC, in pixels of the picture; `-inf` for the first bin.
    pub low_px: f32,
    pub high_px: f32,
    /// A bin pixel covers `scale` x `scale` pixels of the picture: one of [`super::quality_level::SCALES`].
    pub scale: usize,
    /// Side of the cells, in bin pixels, to which its colours are averaged before they are filtered
    /// ([`Settings::privacy`]); 1 if it is not.
    pub decimation: usize,
    /// Columns of the bin's picture.
    pub width: usize,
    pub height: usize,
    /// Largest radius of its content, in bin pixels, compensated for the scale ([`compensated_radius_px`]).
    pub max_radius_px: f32,
    /// Smallest radius of its content, in pixels of the picture, ignoring strays.
    pub min_radius_px: f32,
    /// Whether it is in front of the focal plane.
    pub near: bool,
    /// Index of the executor's buffers it uses; the same from frame to frame.
    pub slot: usize,
}

impl Bin {
    /// Returns the standard deviation, in cells, of the neighbourhood over which a local radius is averaged.
    pub fn sigma_cells(&self) -> f32 {
        (self.max_radius_px / (2.0 * CELL as f32)).max(0.5)
    }

    /// Returns how far a pixel lies at most from those that its decimated colour depends on, in bin pixels: three cells, as
    /// a cell averages two, is sharpened by its neighbours, and pixels lie between two.
    pub fn decimation_reach(&self) -> usize {
        if self.decimation > 1 { 3 * self.decimation } else { 0 }
    }
}

/// The plan for frames of one size. [`Plan::split_by_depth`] updates the part that depends on a frame's depth.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Columns of the picture.
    pub width: usize,
    pub height: usize,
    /// How the bins are composited.
    pub compositing: Compositing,
    pub quality: Quality,
    pub level: QualityLevel,
    /// All quality levels that the plan can be set to.
    pub ladder: Arc<QualityLadder>,
    /// Front to back, by ascending CoC.
    pub bins: Vec<Bin>,
    /// Filters, in bin pixels.
    pub bank: Arc<FilterBank>,
    /// Index of `bank` in the ladder's banks.
    pub bank_index: usize,
    /// Highlight recovery: 1 + 1/M, or infinity when off.
    pub expansion: f32,
    /// True if the rank is full and the method is the paper's: an exact 2-D gather.
    pub exact: bool,
    /// Whether what is behind is steadied ([`Settings::reuse`]).
    pub reuse: bool,
    /// Whether what is behind is decimated ([`Settings::privacy`]).
    pub privacy: bool,
    /// Set if this is the plan of a band of a larger picture ([`Plan::for_band`]).
    band: Option<BandRows>,
    coc: CocKind,
    /// Whether bins stay at full scale up to a radius of [`MAX_FULL_RADIUS_PX`].
    full_scale: bool,
    /// Largest radius in the bin in focus, in pixels.
    focus_px: f32,
    /// Whether hardly any of the content in focus has a radius that shows.
    is_focus_sharp: bool,
    /// Largest CoC radius behind and in front of the focal plane, in pixels.
    max_px: [f32; 2],
    histogram: CocHistogram,
    /// Pieces behind and in front of the focal plane, each outwards.
    ranges: [Vec<CocRange>; 2],
}

impl Plan {
    /// Plans frames of `width` x `height` pixels, at first at the quality of the settings. Radii are clamped to
    /// [`Settings::max_radius_px`].
    pub fn new(settings: &Settings, width: u32, height: u32) -> Self {
        let settings = &settings.with_clamped_radii((width, height));
        let compositing = match (settings.coc, settings.method) {
            (CocKind::Depth, Method::Layered) => Compositing::Layers,
            (CocKind::Depth, Method::Gather) => Compositing::Gather,
            (CocKind::Uniform | CocKind::Ramp, _) => Compositing::Select,
        };
        let ladder = Arc::new(QualityLadder::new(settings, compositing));
        let level = ladder.nearest_level(settings.quality);
        let mut plan = Self {
            width: width as usize,
            height: height as usize,
            compositing,
            quality: level.quality,
            level: level.level,
            bins: Vec::with_capacity(MAX_BINS),
            bank: Arc::clone(&ladder.banks[level.bank]),
            bank_index: level.bank,
            expansion: 1.0 + 1.0 / settings.highlights.max(0.0),
            exact: compositing == Compositing::Gather && settings.rank == Some(Rank::Full),
            reuse: settings.reuse,
            privacy: settings.privacy,
            ladder,
            band: None,
            coc: settings.coc,
            full_scale: settings.rank == Some(Rank::Full),
            focus_px: settings.far_max_px.max(settings.near_max_px),
            is_focus_sharp: false,
            max_px: [settings.far_max_px, settings.near_max_px],
            histogram: CocHistogram::default(),
            ranges: std::array::from_fn(|_| Vec::with_capacity(MAX_RANGES)),
        };
        plan.reset_bins();
        plan
    }

    /// Plans the next frames at another quality, or at the nearest one that the settings allow. Allocates nothing.
    pub fn set_quality(&mut self, quality: Quality) {
        let level = self.ladder.nearest_level(quality);
        if level.quality == self.quality {
            return;
        }
        (self.quality, self.level) = (level.quality, level.level);
        self.bank_index = level.bank;
        self.bank = Arc::clone(&self.ladder.banks[level.bank]);
        self.reset_bins();
    }

    /// Resets the bins to those known without a frame: of a uniform radius or a ramp. With depth there is one bin until
    /// [`Plan::split_by_depth`] has seen a frame.
    fn reset_bins(&mut self) {
        let [far_px, near_px] = self.max_px;
        let [far, near] = &mut self.ranges;
        far.clear();
        near.clear();
        self.focus_px = far_px.max(near_px);
        self.is_focus_sharp = false;
        match self.coc {
            CocKind::Ramp => {
                far.extend(geometric_ranges(far_px, self.level.bins_per_side));
                self.focus_px = far.first().map_or(self.focus_px, |range| range.border_px);
            }
            CocKind::Uniform => far.push(CocRange { border_px: 0.0, low_px: far_px, high_px: far_px }),
            CocKind::Depth => {}
        }
        self.create_bins();
    }

    /// Splits the CoC of a frame into bins, if the CoC follows depth and bins are layers; otherwise the bins stay.
    pub fn split_by_depth(&mut self, depth: Option<&DepthMap>, coc: &CocField) {
        if !self.follows_depth() {
            return;
        }
        match (coc, depth) {
            (CocField::Depth(lens), Some(depth)) => self.histogram.count_depth(depth, lens),
            _ => self.histogram = CocHistogram::default(),
        }
        self.plan_layers();
    }

    /// Same as [`Plan::split_by_depth`], given the radius of every pixel.
    pub fn split_by_radii(&mut self, coc_px: &[f32]) {
        if self.follows_depth() {
            self.histogram.count_radii(coc_px, self.width);
            self.plan_layers();
        }
    }

    /// Returns the radius in front of the focal plane below which everything belongs to the bin in focus, in pixels.
    pub fn near_from_px(&self) -> f32 {
        NEAR_FROM_PX.max(NEAR_FROM_FRACTION * self.max_px[0])
    }

    fn plan_layers(&mut self) {
        let near_from_px = self.near_from_px();
        let sides = [false, true].map(|near| {
            self.histogram.split_side(near, &self.level, near_from_px, &mut self.ranges[usize::from(near)])
        });
        self.focus_px = sides[0].max(sides[1]).min(self.max_px[0].max(self.max_px[1]));
        self.create_bins();
        let focus = self.bins.iter().find(|bin| bin.slot == 0);
        self.is_focus_sharp = focus
            .is_some_and(|bin| self.histogram.defocused_fraction(bin.low_px, bin.high_px) <= MAX_DEFOCUSED_FRACTION);
    }

    /// Makes the bins of the current ranges, front to back. The slot of a bin depends only on its place: 0 in focus,
    /// then those behind, outwards, then those in front; every quality level uses the same order.
    fn create_bins(&mut self) {
        let [far, near] = &self.ranges;
        let per_side = self.ladder.max_bins_per_side();
        let decimates = self.privacy && self.compositing != Compositing::Gather;
        let (bank, height) = (Arc::clone(&self.bank), self.height);
        let inner_px = |ranges: &[CocRange]| ranges.first().map_or(f32::INFINITY, |range| range.border_px);
        let outer_px = |ranges: &[CocRange], k: usize| ranges.get(k + 1).map_or(f32::INFINITY, |range| range.border_px);
        let bin = |(low_px, high_px): (f32, f32), content: (f32, f32), slot: usize| {
            let scale = match self.compositing {
                Compositing::Gather => 1,
                _ if self.full_scale => scale_within(content.1, MAX_FULL_RADIUS_PX),
                _ => self.level.scale(content.0, content.1),
            };
            let is_decimated = decimates && slot > 0 && high_px > 0.0;
            let (scale, decimation) = if is_decimated { decimate(&bank, content, scale, height) } else { (scale, 1) };
            Bin {
                low_px,
                high_px,
                scale,
                decimation,
                width: self.width.div_ceil(scale),
                height: self.height.div_ceil(scale),
                max_radius_px: compensated_radius_px(content.1, scale).min(self.bank.max_radius_px()),
                min_radius_px: content.0,
                near: high_px < 0.0,
                slot,
            }
        };
        self.bins.clear();
        for (k, range) in near.iter().enumerate().rev() {
            let content = (range.low_px, range.high_px.min(self.max_px[1]));
            self.bins.push(bin((-outer_px(near, k), -range.border_px), content, 1 + per_side + k));
        }
        // A uniform radius has border 0, and no pixels in focus.
        if inner_px(far) > 0.0 {
            self.bins.push(bin((-inner_px(near), inner_px(far)), (0.0, self.focus_px), 0));
        }
        for (k, range) in far.iter().enumerate() {
            let content = (range.low_px, range.high_px.min(self.max_px[0]));
            let low_px = if range.border_px > 0.0 { range.border_px } else { f32::NEG_INFINITY };
            self.bins.push(bin((low_px, outer_px(far, k)), content, 1 + k));
        }
    }

    /// Returns the index of the bin in focus, if none of its content is blurred visibly, nor hidden by something in
    /// front: it is shown as it is.
    pub fn sharp_bin(&self) -> Option<usize> {
        self.bins.first().filter(|bin| bin.slot == 0 && self.is_focus_sharp).map(|_| 0)
    }

    /// Returns the rows of a band of the pass `bin`: whole rows of cells of every bin.
    pub fn band_rows(&self) -> usize {
        let coarsest = self.bins.iter().map(|bin| bin.scale).max().unwrap_or(1);
        CELL * coarsest.max(SCALES[2])
    }

    /// Returns the weight function of bin `index`.
    pub fn bin_weight(&self, index: usize) -> BinWeight {
        BinWeight::new(index.checked_sub(1).and_then(|front| self.border(front)), self.border(index))
    }

    /// Returns the mixed pixels of a frame, if they can be separated into two surfaces: only layers can, and only with
    /// depth of the picture's size.
    pub fn matte<'a>(&self, depth: Option<&'a DepthMap>, coc: &CocField) -> Option<&'a Matte> {
        let map = depth.filter(|map| (map.width as usize, map.height as usize) == (self.width, self.height))?;
        let some = 1..=Matte::capacity(self.width, self.picture_rows());
        let apart = self.compositing == Compositing::Layers && matches!(coc, CocField::Depth(_));
        (apart && some.contains(&map.matte.pixels.len())).then_some(&map.matte)
    }

    /// Returns the border between bin `index` and the bin behind it: its CoC, and 1 over the width of the cross-fade.
    pub fn border(&self, index: usize) -> Option<(f32, f32)> {
        let at = self.bins[index].high_px;
        at.is_finite().then(|| (at, 1.0 / (2.0 * CROSS_FADE * at.abs())))
    }
}

#[cfg(test)]
mod tests;
