//! What is done to a frame before it is blurred: from its depth as it was measured come its CoC and its matte, and its subject
//! is staged.

use super::coc::{CocMaker, Finish};
use super::fit_check::{FitCheck, Verdict};
use super::staging::Staging;
use crate::bokeh::Bokeh;
use crate::compute::DeviceFrame;
use crate::frame::crop::Crop;
use crate::frame::{ColorImage, DepthMap};
use crate::link::pool::Pooled;
use crate::look::{BackgroundMemory, Look};
use crate::optics::CocField;

/// Prepares frame after frame.
pub(super) struct Preparation {
    /// Columns and rows of the pictures.
    size: (u32, u32),
    /// Whether depth was measured, so that refining it makes it better.
    measured: bool,
    coc: CocMaker,
    staging: Staging,
    /// Notices depth that does not fit the pictures.
    check: FitCheck,
}

impl Preparation {
    /// For pictures of `size` pixels, so many of them where that is known, as `look` says, on so many threads. Who
    /// `knows_background` needs not remember it.
    pub fn new(
        look: &Look,
        (size, frames): ((u32, u32), Option<u64>),
        measured: bool,
        knows_background: bool,
        threads: usize,
    ) -> Self {
        let coc = CocMaker::new(look.coc_rule(size), Finish::measured(look.refines(measured))).on_threads(threads);
        let mut new = Self { size, measured, coc, staging: Staging::new(look), check: FitCheck::of(frames) };
        new.coc.remember(remembers(look, knows_background));
        new
    }

    /// Follows another look.
    pub fn follow(&mut self, look: &Look, knows_background: bool) {
        self.coc.follow(look.coc_rule(self.size), Finish::measured(look.refines(self.measured)));
        self.coc.remember(remembers(look, knows_background));
        self.staging.follow(look);
    }

    /// Refines depth and finds mattes where the blur runs ([`CocMaker::compute_on`]).
    pub fn beside(&mut self, bokeh: Option<&dyn Bokeh>) {
        self.coc.compute_on(bokeh.and_then(Bokeh::device));
    }

    /// What refined ([`CocMaker::refined_by`]).
    pub fn refined_by(&self) -> Option<&'static str> {
        self.coc.refined_by()
    }

    /// What found mattes ([`CocMaker::matted_by`]).
    pub fn matted_by(&self) -> Option<&'static str> {
        self.coc.matted_by()
    }

    /// The frame that was prepared last, on a device ([`CocMaker::take_copy`]).
    pub fn take_copy(&mut self) -> Option<Pooled<DeviceFrame>> {
        self.coc.take_copy()
    }

    /// Another scene comes: nothing is left of those before.
    pub fn forget(&mut self) {
        self.coc.forget();
    }

    /// The CoC of every frame, where that needs no depth.
    pub fn fixed(&self) -> Option<CocField> {
        self.coc.fixed()
    }

    /// The CoC of the frame that was taken at `time_ns`; finishes its `map`. Once it is clear that the depth does not fit the
    /// pictures, says so, too.
    pub fn make(&mut self, map: &mut DepthMap, color: &ColorImage, time_ns: u64) -> (CocField, Option<String>) {
        let remark = match self.check.look(map, color) {
            None => None,
            Some(Verdict::Unrelated) => Some(
                "nowhere do the outlines of its depth meet those of its pictures: the depth may be of another camera, not \
                 registered to the colours (--depth-calibration), or of another time"
                    .to_owned(),
            ),
            Some(Verdict::Mend(misfit, mending)) => self
                .coc
                .mend(mending)
                .then(|| format!("depth is brought to the pictures, as {misfit}; --refine off takes it as it is")),
        };
        (self.coc.make(map, color, time_ns), remark)
    }

    /// Gives a picture the map of one before it ([`CocMaker::share`]).
    pub fn share(&mut self, map: &mut DepthMap, color: &ColorImage, field: &CocField) {
        self.coc.share(map, color, field);
    }

    /// Whether it changes pictures of this CoC ([`Staging::replaces`]).
    pub fn replaces(&self, field: &CocField) -> bool {
        self.staging.replaces(field)
    }

    /// Puts what was chosen behind the subject; returns the part of the picture to show, `None` for all
    /// ([`Staging::stage`]).
    pub fn stage(
        &mut self,
        color: &mut ColorImage,
        map: &mut DepthMap,
        field: &CocField,
        time_ns: u64,
    ) -> Option<Crop> {
        self.staging.stage(color, map, field, time_ns)
    }
}

fn remembers(look: &Look, knows_background: bool) -> bool {
    look.background_memory == BackgroundMemory::On && !knows_background
}
