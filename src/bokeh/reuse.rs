//! Temporal reuse: which parts of a blurred picture may be kept from an earlier frame.
//!
//! A blur averages over its aperture, so sensor noise hardly changes its result, and most of a video call's background
//! is still. The picture is surveyed in small tiles; their means over about the area of the aperture predict the
//! blurred result. Where the prediction has moved by less than a bound since the frame **from which the result was
//! made**, the result is kept. The reference is never the frame before, so that errors cannot add up. Content in focus
//! is never kept.

use std::ops::Range;

use super::plan::{Bin, CELL, Plan};
use super::quality_level::SCALES;
use crate::frame::change::{Prediction, TILE};

/// Bins whose content has at least this radius, in pixels, are kept; below, a result follows details that the means of
/// tiles do not show.
pub const MIN_KEPT_RADIUS_PX: f32 = 3.5;
/// Columns of a unit, the smallest part that is kept, in pixels.
pub const UNIT_W: usize = 128;
/// Rows of a unit in pixels, unless a coarse bin needs more.
const UNIT_H: usize = 16;
/// A result is made anew after this number of frames at most.
const MAX_AGE: usize = 128;
/// Rows made anew together because of their age, in pixels: the filters read rows around them, which they share.
const RENEWED_H: usize = 64;
/// If more than this fraction of the units changes, all are made anew.
const MAX_CHANGED: f32 = 0.85;
/// While all units change, only every so many frames are tested, so that a moving camera pays next to nothing.
const TEST_PERIOD: u32 = 4;

/// The units of a picture that must be made anew.
#[derive(Clone, Debug, Default)]
pub struct Units {
    /// Row by row.
    changed: Vec<bool>,
    across: usize,
    down: usize,
    /// Rows of a unit in pixels.
    height_px: usize,
}

impl Units {
    /// Whether any unit of these columns and rows, in pixels, must be made anew.
    #[inline(always)]
    pub fn any_changed(&self, columns: Range<usize>, rows: Range<usize>) -> bool {
        let columns = columns.start / UNIT_W..columns.end.div_ceil(UNIT_W).min(self.across);
        let mut rows = rows.start / self.height_px..rows.end.div_ceil(self.height_px).min(self.down);
        rows.any(|row| self.changed[row * self.across..][columns.clone()].iter().any(|&changed| changed))
    }

    /// Returns the fraction that may be kept.
    pub fn kept_fraction(&self) -> f32 {
        let changed = self.changed.iter().filter(|&&changed| changed).count();
        1.0 - changed as f32 / self.changed.len().max(1) as f32
    }
}

/// Decides what is kept from frame to frame, the same on every executor.
pub struct ChangeDetector {
    pub prediction: Prediction,
    units: Units,
    /// What the results depend on besides the surveyed frame; `None` before the first.
    generation: Option<u64>,
    /// Frames since everything was made anew, for the rows whose turn it is.
    frame: usize,
    /// Frames until the next test while everything changes.
    wait: u32,
}

impl ChangeDetector {
    /// Allocates for pictures of `width` x `height` pixels.
    pub fn new(width: usize, height: usize) -> Self {
        let units = Vec::with_capacity(width.div_ceil(UNIT_W) * height.div_ceil(UNIT_H));
        Self {
            prediction: Prediction::new(width, height),
            units: Units { changed: units, ..Units::default() },
            generation: None,
            frame: 0,
            wait: 0,
        }
    }

    /// Forgets every result: the next frame is made anew.
    pub fn clear(&mut self) {
        (self.generation, self.wait) = (None, 0);
    }

    /// Whether later frames may keep the current frame's result.
    pub fn has_reference(&self) -> bool {
        self.generation.is_some()
    }

    /// Whether the next frame must be surveyed; otherwise it is made anew without ([`Self::skip`]).
    pub fn needs_survey(&self) -> bool {
        self.wait == 0
    }

    /// Counts a frame that is made anew without a survey.
    pub fn skip(&mut self) {
        self.wait -= 1;
        self.generation = None;
    }

    /// Finds what must be made anew, after the frame was surveyed. Returns false if that is the whole picture.
    pub fn detect(&mut self, plan: &Plan) -> bool {
        let kept = || plan.bins.iter().filter(|bin| is_kept(bin));
        let least_px = kept().map(|bin| bin.min_radius_px).fold(f32::INFINITY, f32::min);
        let scale = kept().map(|bin| bin.scale).max().unwrap_or(SCALES[0]);
        let first = self.generation.replace(plan.generation) != Some(plan.generation);
        self.shape_units(plan, scale);
        self.prediction.predict(least_px);
        if first || !least_px.is_finite() {
            self.frame = 0;
            self.prediction.refer_to_all();
            return false;
        }
        let tile_rows = self.units.height_px / TILE;
        for (row, units) in self.units.changed.chunks_exact_mut(self.units.across).enumerate() {
            self.prediction.find_changed(row * tile_rows..(row + 1) * tile_rows, UNIT_W / TILE, units);
        }
        let (across, changed) = (self.units.across, &mut self.units.changed);
        self.frame += 1;
        let rows = RENEWED_H.div_ceil(self.units.height_px);
        let groups = self.units.down.div_ceil(rows);
        let period = (MAX_AGE / groups).max(1);
        if self.frame.is_multiple_of(period) {
            let first = self.frame / period % groups * rows;
            changed[first * across..((first + rows) * across).min(across * self.units.down)].fill(true);
        }
        if self.units.kept_fraction() < 1.0 - MAX_CHANGED {
            self.wait = TEST_PERIOD - 1;
            self.prediction.refer_to_all();
            return false;
        }
        for (row, units) in self.units.changed.chunks_exact(across).enumerate() {
            self.prediction.refer_to(row * tile_rows..(row + 1) * tile_rows, UNIT_W / TILE, units);
        }
        true
    }

    /// Returns the units that must be made anew, if [`Self::detect`] returned true.
    pub fn units(&self) -> &Units {
        &self.units
    }

    fn shape_units(&mut self, plan: &Plan, scale: usize) {
        let units = &mut self.units;
        units.height_px = UNIT_H.max(CELL * scale);
        (units.across, units.down) = (plan.width.div_ceil(UNIT_W), plan.height.div_ceil(units.height_px));
        units.changed.clear();
        units.changed.resize(units.across * units.down, false);
    }
}

/// Whether the result of a bin may be kept. Near objects move most, and are few.
pub fn is_kept(bin: &Bin) -> bool {
    !bin.near && bin.min_radius_px >= MIN_KEPT_RADIUS_PX
}
