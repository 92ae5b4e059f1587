//! Temporal reuse: which parts of a blurred picture may be kept from an earlier frame.
//!
//! A blur averages over its aperture, so sensor noise hardly changes its result, and most of a video call's background
//! is still. The picture is surveyed in small tiles; their means over about the area of the aperture predict the
//! blurred result. This decides twice:
//!
//! 1. **Content** that changes the prediction by less than a bound stays in the bins. The picture that the bins hold is
//!    then made of the newest frame where something moves, and of earlier ones elsewhere.
//! 2. A **result** is kept while the prediction of the held content differs by less than a bound from that of the
//!    content **of which it was made**. The reference is never the frame before, so that errors cannot add up.
//!
//! What is in focus is never kept, nor is the content beside it.

use std::ops::Range;

use super::plan::{CELL, Plan};
use super::quality_level::SCALES;
use crate::frame::change::{Prediction, TILE};

/// Columns and rows of the smallest result that is kept, in pixels, unless a coarse bin needs more rows.
const RESULT_SIZE: (usize, usize) = (64, 16);
/// Columns of the smallest content that is kept, in pixels, unless a coarse bin needs more.
const CONTENT_W: usize = 64;
/// Content is kept in whole columns of this width in every bin, in bin pixels.
pub const CONTENT_BIN_W: usize = 32;
/// A result is recomputed after this number of frames at most.
const MAX_AGE: usize = 128;
/// Rows recomputed together because of their age, in pixels: the filters read rows around them, which they share.
const RENEWED_H: usize = 64;
/// If more than this fraction of the units changes, all are recomputed.
const MAX_CHANGED: f32 = 0.85;
/// If everything changes in several frames in turn, up to this number of frames are not tested, so that a moving camera
/// pays next to nothing.
const MAX_UNTESTED: u32 = 7;

/// The parts of a picture that must be recomputed, in units of one size.
#[derive(Clone, Debug, Default)]
pub struct Units {
    /// Row by row.
    changed: Vec<bool>,
    across: usize,
    down: usize,
    /// Columns and rows of a unit in pixels.
    width_px: usize,
    height_px: usize,
}

impl Units {
    /// Unmarks all units of a picture.
    fn reset(&mut self, plan: &Plan, (width_px, height_px): (usize, usize)) {
        (self.width_px, self.height_px) = (width_px, height_px);
        (self.across, self.down) = (plan.width.div_ceil(width_px), plan.height.div_ceil(height_px));
        self.changed.clear();
        self.changed.resize(self.across * self.down, false);
    }

    /// Returns the columns of a unit in pixels.
    pub fn width_px(&self) -> usize {
        self.width_px
    }

    /// Whether any unit of these columns and rows, in pixels, must be recomputed.
    #[inline(always)]
    pub fn any_changed(&self, columns: Range<usize>, rows: Range<usize>) -> bool {
        let columns = columns.start / self.width_px..columns.end.div_ceil(self.width_px).min(self.across);
        let mut rows = rows.start / self.height_px..rows.end.div_ceil(self.height_px).min(self.down);
        rows.any(|row| self.changed[row * self.across..][columns.clone()].iter().any(|&changed| changed))
    }

    /// Returns the fraction that may be kept.
    pub fn kept_fraction(&self) -> f32 {
        let changed = self.changed.iter().filter(|&&changed| changed).count();
        1.0 - changed as f32 / self.changed.len().max(1) as f32
    }

    /// Marks rows that begin in the given range of pixels.
    fn mark_rows(&mut self, rows: &Range<usize>) {
        let rows = rows.start.div_ceil(self.height_px)..rows.end.div_ceil(self.height_px).min(self.down);
        let units = (rows.start * self.across).min(self.changed.len())..rows.end * self.across;
        self.changed.get_mut(units).into_iter().for_each(|units| units.fill(true));
    }

    /// Calls `each` with the rows of tiles and the units of each row of units, and the number of tiles across a unit.
    fn for_each_row(&mut self, mut each: impl FnMut(Range<usize>, usize, &mut [bool])) {
        let (tiles_across, tiles_down) = (self.width_px / TILE, self.height_px / TILE);
        for (row, units) in self.changed.chunks_exact_mut(self.across).enumerate() {
            each(row * tiles_down..(row + 1) * tiles_down, tiles_across, units);
        }
    }
}

/// Decides what is kept from frame to frame, the same on every executor.
pub struct ChangeDetector {
    pub prediction: Prediction,
    content: Units,
    results: Units,
    /// What the results depend on besides the surveyed frame; `None` before the first.
    generation: Option<u64>,
    /// Frames since everything was recomputed, for the rows whose turn it is.
    frame: usize,
    /// Frames left until the next test, and the back-off: the number to skip if that test finds everything changed.
    untested: [u32; 2],
}

impl ChangeDetector {
    /// Allocates for pictures of `width` x `height` pixels.
    pub fn new(width: usize, height: usize) -> Self {
        let units = || {
            let most = width.div_ceil(CONTENT_W) * height.div_ceil(RESULT_SIZE.1);
            Units { changed: Vec::with_capacity(most), ..Units::default() }
        };
        Self {
            prediction: Prediction::new(width, height),
            content: units(),
            results: units(),
            generation: None,
            frame: 0,
            untested: [0; 2],
        }
    }

    /// Forgets every result: the next frame is recomputed.
    pub fn clear(&mut self) {
        (self.generation, self.untested) = (None, [0; 2]);
    }

    /// Whether later frames may keep the current frame's result.
    pub fn has_reference(&self) -> bool {
        self.generation.is_some()
    }

    /// Whether the next frame must be surveyed; otherwise it is recomputed without ([`Self::skip`]).
    pub fn needs_survey(&self) -> bool {
        self.untested[0] == 0
    }

    /// Counts a frame that is recomputed without a survey.
    pub fn skip(&mut self) {
        self.untested[0] -= 1;
        self.generation = None;
    }

    /// Finds what must be recomputed, after the frame was surveyed; `is_beside_fresh` tells whether content that is never
    /// kept is in or beside some columns and rows with other content. Returns false if everything is recomputed.
    pub fn detect(&mut self, plan: &Plan, is_beside_fresh: impl Fn(Range<usize>, Range<usize>) -> bool) -> bool {
        let kept = || plan.bins.iter().filter(|bin| bin.is_kept());
        let least_px = kept().map(|bin| bin.min_radius_px).fold(f32::INFINITY, f32::min);
        let is_other = self.generation.replace(plan.generation) != Some(plan.generation);
        self.prediction.predict(least_px);
        if is_other || !least_px.is_finite() {
            self.frame = 0;
            self.prediction.make_all();
            return false;
        }
        self.frame += 1;
        let renewed = self.renewed_rows(plan.height);
        let Self { prediction, content, results, .. } = self;
        content.reset(plan, content_size(plan));
        content.for_each_row(|rows, across, units| prediction.find_changed(rows, across, units));
        content.mark_rows(&renewed);
        if content.kept_fraction() < 1.0 - MAX_CHANGED {
            let [_, next] = self.untested;
            self.untested = [next, (2 * next + 1).min(MAX_UNTESTED)];
            prediction.make_all();
            return false;
        }
        self.untested[1] = 0;
        for (unit, changed) in content.changed.iter_mut().enumerate().filter(|(_, changed)| !**changed) {
            let (x, y) = (unit % content.across * content.width_px, unit / content.across * content.height_px);
            *changed = is_beside_fresh(x..x + content.width_px, y..y + content.height_px);
        }
        content.for_each_row(|rows, across, units| prediction.hold(rows, across, units));
        prediction.predict_held();
        let scale = plan.bins.iter().filter(|bin| bin.is_kept()).map(|bin| bin.scale).max().unwrap_or(SCALES[0]);
        results.reset(plan, (RESULT_SIZE.0, RESULT_SIZE.1.max(CELL * scale)));
        results.for_each_row(|rows, across, units| prediction.find_outdated(rows, across, units));
        results.mark_rows(&renewed);
        results.for_each_row(|rows, across, units| prediction.make(rows, across, units));
        true
    }

    /// Returns the rows of the picture whose turn it is to be renewed in this frame, in pixels; mostly none.
    fn renewed_rows(&self, height: usize) -> Range<usize> {
        let groups = height.div_ceil(RENEWED_H);
        let period = (MAX_AGE / groups).max(1);
        let first = self.frame / period % groups * RENEWED_H;
        if self.frame.is_multiple_of(period) { first..(first + RENEWED_H).min(height) } else { 0..0 }
    }

    /// Returns the content that must be recomputed, if [`Self::detect`] returned true.
    pub fn content(&self) -> &Units {
        &self.content
    }

    /// Returns the results that must be recomputed, if [`Self::detect`] returned true.
    pub fn results(&self) -> &Units {
        &self.results
    }
}

/// Returns the columns and rows of the smallest content that is kept, in pixels: whole columns and rows of cells of every
/// bin. The bins are made in groups of these rows, not too few, as each group reads some of its neighbours again.
pub fn content_size(plan: &Plan) -> (usize, usize) {
    let coarsest = plan.bins.iter().map(|bin| bin.scale).max().unwrap_or(1);
    (CONTENT_W.max(CONTENT_BIN_W * coarsest), CELL * coarsest.max(SCALES[2]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::look::{Effect, Look};

    #[test]
    fn content_beside_what_is_never_kept_is_made_anew() {
        let settings = Look::with_effect(Effect::Blur).blur_settings((512, 256), false).expect("it blurs");
        let (plan, mut detector) = (Plan::new(&settings, 512, 256), ChangeDetector::new(512, 256));
        detector.prediction.means.planes.iter_mut().for_each(|plane| plane.fill(100.0));
        assert!(!detector.detect(&plan, |_, _| false), "the first frame is made anew");
        for fresh in [0..0, 0..1, 100..200, 300..512] {
            let is_within = |columns: &Range<usize>| columns.start < fresh.end && fresh.start < columns.end;
            assert!(detector.detect(&plan, |columns, _| is_within(&columns)));
            let content = detector.content();
            for x in (0..512).step_by(content.width_px()) {
                let columns = x..x + content.width_px();
                assert_eq!(content.any_changed(columns.clone(), 0..256), is_within(&columns), "{fresh:?} {columns:?}");
            }
            assert_eq!(detector.results().kept_fraction(), 1.0, "the result of equal content is the same");
        }
    }
}
