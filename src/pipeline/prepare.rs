//! What is done to a frame before it is blurred: from its depth as it was measured come its CoC and its matte, and its subject
//! is staged.

use super::coc::{CocMaker, Finish};
use super::fit_check::{FitCheck, Verdict};
use super::staging::Staging;
use crate::bokeh::Bokeh;
use crate::compute::DeviceFrame;
use crate::depth::refine::Exactness;
use crate::frame::crop::Crop;
use crate::frame::{ColorImage, DepthMap};
use crate::link::pool::Pooled;
use crate::look::{BackgroundMemory, Look, Refine};
use crate::optics::CocField;

/// Said in the report where depth is refined only until it is known to be exact.
const EXACT: &str = "none, as depth is exact";

/// Prepares frame after frame.
pub(super) struct Preparation {
    /// Columns and rows of the pictures.
    size: (u32, u32),
    /// Whether depth was measured, so that refining it makes it better.
    measured: bool,
    /// What the look asks to be done to depth.
    finish: Finish,
    coc: CocMaker,
    /// Tells exact depth, which is not refined unless that is asked for; `None` where nothing is left to be decided.
    exactness: Option<Exactness>,
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
        let finish = Finish::measured(look.refines(measured));
        let coc = CocMaker::new(look.coc_rule(size), finish).on_threads(threads);
        let (exactness, staging, check) = (exactness(look, finish), Staging::new(look), FitCheck::of(frames));
        let mut new = Self { size, measured, finish, coc, exactness, staging, check };
        new.coc.remember(remembers(look, knows_background));
        new
    }

    /// Follows another look.
    pub fn follow(&mut self, look: &Look, knows_background: bool) {
        self.finish = Finish::measured(look.refines(self.measured));
        self.exactness = exactness(look, self.finish).map(|new| self.exactness.take().unwrap_or(new));
        self.coc.follow(look.coc_rule(self.size), self.finish_now());
        self.coc.remember(remembers(look, knows_background));
        self.staging.follow(look);
    }

    /// Refines depth and finds mattes where the blur runs ([`CocMaker::compute_on`]).
    pub fn beside(&mut self, bokeh: Option<&dyn Bokeh>) {
        self.coc.compute_on(bokeh.and_then(Bokeh::device));
    }

    /// What is done to depth as far as is known now: exact depth fits already, and what is thin in it would be lost.
    fn finish_now(&self) -> Finish {
        let is_exact = self.exactness.as_ref().is_some_and(Exactness::is_exact) && self.check.meets();
        if is_exact { Finish::Fill } else { self.finish }
    }

    /// What refines, for the report ([`CocMaker::refined_by`]); or did so until depth turned out to be exact.
    pub fn refined_by(&self) -> Option<&'static str> {
        let is_left_alone = self.finish == Finish::Refine && self.finish_now() == Finish::Fill;
        if is_left_alone { Some(EXACT) } else { self.coc.refined_by() }
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
        self.exactness.iter_mut().for_each(Exactness::forget);
        self.coc.forget();
    }

    /// Whether the lens is focused on a subject that is found ([`CocMaker::focuses_on_subject`]).
    pub fn focuses_on_subject(&self) -> bool {
        self.coc.focuses_on_subject()
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
        if let Some(exactness) = &mut self.exactness {
            exactness.look(map, color);
            self.coc.finish_by(self.finish_now());
        }
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

/// Watches depth where it is to be refined, and only because it was measured.
fn exactness(look: &Look, finish: Finish) -> Option<Exactness> {
    (look.refine == Refine::Auto && finish == Finish::Refine).then(Exactness::default)
}

fn remembers(look: &Look, knows_background: bool) -> bool {
    look.background_memory == BackgroundMemory::On && !knows_background
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::recording::still::{read_color, read_depth};

    fn portrait() -> (ColorImage, DepthMap) {
        let file = |name: &str| Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/portrait").join(name);
        let color = read_color(&file("rgb/000000.png")).unwrap();
        (color, read_depth(&file("depth/000000.png"), 5000.0, None).unwrap())
    }

    /// The map of the last of some frames of which each has this one, and what is said of its refinement.
    fn prepared(refine: Refine, (color, map): (&ColorImage, &DepthMap)) -> (DepthMap, Option<&'static str>) {
        let look = Look { refine, background_memory: BackgroundMemory::Off, ..Look::default() };
        let mut preparation = Preparation::new(&look, (color.size(), None), true, false, 1);
        let mut last = map.clone();
        for frame in 0..6 {
            last.clone_from(map);
            preparation.make(&mut last, color, frame * 33_333_333);
        }
        (last, preparation.refined_by())
    }

    #[test]
    fn exact_depth_of_a_stream_stays_as_it_is_with_all_that_is_thin() {
        let (color, map) = portrait();
        let (auto, said) = prepared(Refine::Auto, (&color, &map));
        assert!(auto.metres == map.metres && said == Some(EXACT), "{said:?}");
        let (on, said) = prepared(Refine::On, (&color, &map));
        assert!(on.metres != map.metres && said == Some("cpu"), "where it is asked for it is refined: {said:?}");
    }

    #[test]
    fn a_sensors_depth_is_refined_as_it_is_where_that_is_asked_for() {
        let (color, mut map) = portrait();
        // Holes, as beside every near thing.
        map.metres.iter_mut().step_by(40).for_each(|metres| *metres = 0.0);
        let [(auto, said), (on, _)] = [Refine::Auto, Refine::On].map(|refine| prepared(refine, (&color, &map)));
        assert!(auto.metres == on.metres && said == Some("cpu"), "{said:?}");
    }
}
