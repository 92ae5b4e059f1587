//! The first half: from a frame's depth as it was measured come its CoC and its matte, and its subject is staged.

use super::coc::{CocMaker, Finish};
use super::fit_check::{FitCheck, Verdict};
use super::staging::{Staging, Taken};
use crate::bokeh::{Bokeh, BokehError};
use crate::compute::DeviceFrame;
use crate::depth::refine::Exactness;
use crate::frame::crop::Crop;
use crate::frame::{ColorImage, DepthMap};
use crate::link::pool::{Pool, Pooled};
use crate::look::{BackgroundMemory, Look, Refine};
use crate::optics::CocField;

/// Said in the report where depth is refined only until it is known to be exact.
const EXACT: &str = "none, as depth is exact";

/// What is known of depth before it comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Origin {
    /// It was finished before.
    Finished,
    /// That of a picture on its own, which nobody knows more of: where the look leaves that open it is refined if it does not fit
    /// the picture.
    Single,
    /// It was made, and not measured: refining it makes it no better.
    Made,
    /// It was measured: refining it makes it better, unless it turns out to be exact.
    Measured,
}

impl Origin {
    /// What a look asks to be done to depth.
    fn finish(self, look: &Look) -> Finish {
        match self {
            Self::Finished => Finish::Keep,
            Self::Single | Self::Made => Finish::measured(look.refines(false)),
            Self::Measured => Finish::measured(look.refines(true)),
        }
    }
}

/// The frames that come.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Input {
    /// Columns and rows of the pictures.
    pub size: (u32, u32),
    /// How many there are, where that is known.
    pub frames: Option<u64>,
    pub depth: Origin,
    /// Whether the depth has all that is behind the nearer surface, so that nothing need be remembered.
    pub knows_background: bool,
    /// Threads to work on, the caller's included: what is made is the same to the bit.
    pub threads: usize,
}

/// What is done to a frame once its CoC is known.
#[derive(Default)]
pub(crate) struct Staged {
    /// The part of the picture to show; `None` is all.
    pub part: Option<Crop>,
    /// The frame as it was before something else stood behind the subject, where that is so and it is to be kept.
    pub taken: Option<Pooled<Taken>>,
    /// The picture and its depth, where a device has refined that.
    pub on_device: Option<Pooled<DeviceFrame>>,
}

/// Prepares frame after frame.
pub(crate) struct Preparation {
    input: Input,
    /// What the look asks to be done to depth.
    finish: Finish,
    coc: CocMaker,
    /// Tells exact depth, which is not refined unless that is asked for; `None` where nothing is left to be decided.
    exactness: Option<Exactness>,
    staging: Staging,
    /// Notices depth that does not fit the pictures; `None` where nothing would come of that.
    check: Option<FitCheck>,
    /// What is to be said of the depth.
    remark: Option<String>,
}

impl Preparation {
    /// As `look` says.
    pub fn new(look: &Look, input: Input) -> Self {
        let finish = input.depth.finish(look);
        let checks = match input.depth {
            Origin::Finished => false,
            Origin::Single => look.refine != Refine::Off,
            Origin::Made | Origin::Measured => true,
        };
        let mut new = Self {
            input,
            finish,
            coc: CocMaker::new(look.coc_rule(input.size), finish).on_threads(input.threads),
            exactness: exactness(look, finish),
            staging: Staging::new(look),
            check: checks.then(|| FitCheck::of(input.frames)),
            remark: None,
        };
        new.coc.remember(new.remembers(look));
        new
    }

    /// Follows another look.
    pub fn follow(&mut self, look: &Look) {
        self.finish = self.input.depth.finish(look);
        self.exactness = exactness(look, self.finish).map(|new| self.exactness.take().unwrap_or(new));
        self.coc.follow(look.coc_rule(self.input.size), self.finish_now());
        self.coc.remember(self.remembers(look));
        self.staging.follow(look);
    }

    /// Whether it remembers what lies behind things, from frame to frame.
    fn remembers(&self, look: &Look) -> bool {
        let is_stream = matches!(self.input.depth, Origin::Made | Origin::Measured);
        is_stream && look.background_memory == BackgroundMemory::On && !self.input.knows_background
    }

    /// Refines depth and finds mattes where the blur runs ([`CocMaker::compute_on`]).
    pub fn beside(&mut self, bokeh: Option<&dyn Bokeh>) {
        self.coc.compute_on(bokeh.and_then(Bokeh::device));
    }

    /// What is done to depth as far as is known now: exact depth fits already, and what is thin in it would be lost.
    fn finish_now(&self) -> Finish {
        let meets = self.check.as_ref().is_some_and(FitCheck::meets);
        let is_exact = self.exactness.as_ref().is_some_and(Exactness::is_exact) && meets;
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

    /// What is to be said of the depth, once: that it does not fit the pictures.
    pub fn remark(&mut self) -> Option<String> {
        self.remark.take()
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

    /// The CoC of the frame that was taken at `time_ns`; finishes its `map`.
    pub fn make(&mut self, map: &mut DepthMap, color: &ColorImage, time_ns: u64) -> CocField {
        match self.check.as_mut().and_then(|check| check.look(map, color)) {
            None => {}
            Some(Verdict::Unrelated) => {
                self.remark = Some(
                    "nowhere do the outlines of its depth meet those of its pictures: the depth may be of another camera, \
                     not registered to the colours (--depth-calibration), or of another time"
                        .to_owned(),
                );
            }
            Some(Verdict::Mend(misfit, mending)) => {
                if self.coc.mend(mending) {
                    let line = format!("depth is brought to the pictures, as {misfit}; --refine off takes it as it is");
                    self.remark = Some(line);
                } else if self.input.depth == Origin::Single {
                    self.finish = Finish::Refine;
                    self.coc.finish_by(Finish::Refine);
                }
            }
        }
        if let Some(exactness) = &mut self.exactness {
            exactness.look(map, color);
            self.coc.finish_by(self.finish_now());
        }
        self.coc.make(map, color, time_ns)
    }

    /// Gives a picture the map of one before it ([`CocMaker::share`]).
    pub fn share(&mut self, map: &mut DepthMap, color: &ColorImage, field: &CocField) {
        self.coc.share(map, color, field);
    }

    /// Puts what was chosen behind the subject of a picture whose depth is finished; keeps the frame as it was in a buffer of
    /// `kept`, if that changes it ([`Staging::stage`]).
    pub fn stage(
        &mut self,
        color: &mut ColorImage,
        map: &mut DepthMap,
        field: &CocField,
        time_ns: u64,
        kept: Option<&Pool<Taken>>,
    ) -> Staged {
        let replaces = self.staging.replaces(field);
        let taken = kept.filter(|_| replaces).map(|pool| {
            let mut taken = pool.take();
            taken.keep(color, map);
            taken
        });
        // What is staged has another picture.
        let on_device = self.coc.take_copy().filter(|_| !replaces);
        Staged { part: self.staging.stage(color, map, field, time_ns), taken, on_device }
    }

    /// All of it for the frame that was taken at `time_ns`: its CoC, and the part of it to show, `None` for all.
    ///
    /// # Errors
    /// [`BokehError::NoDepth`] where the CoC follows depth.
    pub fn prepare(
        &mut self,
        color: &mut ColorImage,
        map: Option<&mut DepthMap>,
        time_ns: u64,
    ) -> Result<(CocField, Option<Crop>), BokehError> {
        if let Some(field) = self.fixed() {
            return Ok((field, None));
        }
        let map = map.ok_or(BokehError::NoDepth)?;
        let field = self.make(map, color, time_ns);
        Ok((field, self.stage(color, map, &field, time_ns, None).part))
    }
}

/// Watches depth where it is to be refined, and only because it was measured.
fn exactness(look: &Look, finish: Finish) -> Option<Exactness> {
    (look.refine == Refine::Auto && finish == Finish::Refine).then(Exactness::default)
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
        let (size, depth) = (color.size(), Origin::Measured);
        let input = Input { size, frames: None, depth, knows_background: false, threads: 1 };
        let mut preparation = Preparation::new(&look, input);
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
