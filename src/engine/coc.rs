//! From a frame's depth to its circle of confusion (CoC): the one step that every blur by depth goes through.

use std::sync::Arc;

use crate::compute::thread_pool::ThreadPool;
use crate::compute::{Device, DeviceFrame};
use crate::depth::background::Background;
use crate::depth::fill::Filler;
use crate::depth::focus::{Focus, FocusRule};
use crate::depth::matting::{self, Matting};
use crate::depth::refine::{Mending, Refiner};
use crate::frame::{ColorImage, DepthMap};
use crate::link::pool::Pooled;
use crate::look::CocRule;
use crate::optics::CocField;

/// What is done to a depth map before it is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finish {
    /// Nothing: it was finished before.
    Keep,
    /// Holes are filled.
    Fill,
    /// It is fitted to the picture and steadied, and holes are filled.
    Refine,
}

impl Finish {
    /// Of depth as it was measured.
    pub fn measured(refine: bool) -> Self {
        if refine { Self::Refine } else { Self::Fill }
    }
}

/// A [`CocRule`] at work, from frame to frame.
pub struct CocMaker {
    rule: CocRule,
    focus: Focus,
    finisher: Finisher,
    mending: Mending,
    /// Where depth is refined and mattes are found, if not on the processor.
    device: Option<Arc<Device>>,
    matting: Matting,
    /// Whether a matte was looked for since it is known where: a device is not tried for nothing.
    has_matted: bool,
    background: Option<Background>,
    workers: ThreadPool,
}

enum Finisher {
    Keep,
    Fill(Box<Filler>),
    Refine(Box<Refiner>),
}

impl Finisher {
    fn new(finish: Finish, mending: Mending, device: Option<&Arc<Device>>) -> Self {
        match finish {
            Finish::Keep => Self::Keep,
            Finish::Fill => Self::Fill(Box::default()),
            Finish::Refine => Self::Refine(Box::new(Refiner::mending(mending).on(device))),
        }
    }

    fn finish(&self) -> Finish {
        match self {
            Self::Keep => Finish::Keep,
            Self::Fill(_) => Finish::Fill,
            Self::Refine(_) => Finish::Refine,
        }
    }
}

fn focus_of(rule: CocRule) -> FocusRule {
    match rule {
        CocRule::Fixed(_) => FocusRule::Auto,
        CocRule::Depth { focus, .. } => focus,
    }
}

impl CocMaker {
    /// Nothing was seen yet. It works on the caller's thread.
    pub fn new(rule: CocRule, finish: Finish) -> Self {
        let (focus, mending) = (Focus::new(focus_of(rule)), Mending::default());
        let (finisher, matting) = (Finisher::new(finish, mending, None), Matting::default());
        Self {
            rule,
            focus,
            finisher,
            mending,
            device: None,
            matting,
            has_matted: false,
            background: None,
            workers: ThreadPool::new("depth", 1),
        }
    }

    /// Whether the lens is focused on a subject that is found.
    pub fn focuses_on_subject(&self) -> bool {
        matches!(self.rule, CocRule::Depth { focus: FocusRule::Auto, .. })
    }

    /// The same on so many threads, the caller's included: what is made is the same to the bit.
    pub fn on_threads(self, threads: usize) -> Self {
        Self { workers: ThreadPool::new("depth", threads), ..self }
    }

    /// Refines and finds mattes on a device from now on; nothing changes where that is `None`, or the one that does so already.
    pub fn compute_on(&mut self, device: Option<Arc<Device>>) {
        let is_other = |device: &Arc<Device>| !self.device.as_ref().is_some_and(|own| Arc::ptr_eq(own, device));
        if let Some(device) = device.filter(is_other) {
            self.device = Some(device);
            self.has_matted = false;
            if matches!(self.finisher, Finisher::Refine(_)) {
                self.renew(Finish::Refine);
            }
        }
    }

    /// What refined, for the report; `None` where nothing is refined.
    pub fn refined_by(&self) -> Option<&'static str> {
        match (&self.finisher, self.rule) {
            (Finisher::Refine(refiner), CocRule::Depth { .. }) => Some(refiner.backends()),
            _ => None,
        }
    }

    /// A copy of the last map that it made, with its picture, where a device has both: once for each.
    pub fn take_copy(&mut self) -> Option<Pooled<DeviceFrame>> {
        match &mut self.finisher {
            Finisher::Refine(refiner) => refiner.take_copy(),
            Finisher::Keep | Finisher::Fill(_) => None,
        }
    }

    /// What found mattes, for the report; `None` where none was looked for.
    pub fn matted_by(&self) -> Option<&'static str> {
        self.has_matted.then(|| self.matting.backends())
    }

    /// Finishes maps with no memory of those before.
    fn renew(&mut self, finish: Finish) {
        let uses_depth = matches!(self.rule, CocRule::Depth { .. });
        // What the finisher of before left on the device is not of the next map.
        self.matting.take_from(None);
        self.finisher = Finisher::new(finish, self.mending, self.device.as_ref().filter(|_| uses_depth));
    }

    /// Mends every map from now on, where it is refined; whether it is.
    pub fn mend(&mut self, mending: Mending) -> bool {
        let refines = matches!(self.finisher, Finisher::Refine(_));
        if std::mem::replace(&mut self.mending, mending) != mending && refines {
            self.renew(Finish::Refine);
        }
        refines
    }

    /// Finishes maps so from now on.
    pub fn finish_by(&mut self, finish: Finish) {
        if self.finisher.finish() != finish {
            self.renew(finish);
        }
    }

    /// Remembers from now on, or no more, what lies behind things.
    pub fn remember(&mut self, remembers: bool) {
        if self.background.is_some() != remembers {
            self.background = remembers.then(Background::default);
        }
    }

    /// Another scene comes: nothing is left of those before.
    pub fn forget(&mut self) {
        self.focus = Focus::new(focus_of(self.rule));
        match &mut self.finisher {
            Finisher::Keep => {}
            Finisher::Fill(filler) => **filler = Filler::new(),
            Finisher::Refine(refiner) => refiner.forget(),
        }
        self.background = self.background.take().map(|_| Background::default());
    }

    /// Follows another rule, from where the lens stands now.
    pub fn follow(&mut self, rule: CocRule, finish: Finish) {
        match (std::mem::replace(&mut self.rule, rule), rule) {
            (CocRule::Depth { .. }, CocRule::Depth { focus, .. }) => {
                self.focus.follow(focus);
                self.finish_by(finish);
            }
            _ => {
                self.focus = Focus::new(focus_of(rule));
                self.renew(finish);
            }
        }
    }

    /// The CoC of every frame, where that needs no depth.
    pub fn fixed(&self) -> Option<CocField> {
        match self.rule {
            CocRule::Fixed(field) => Some(field),
            CocRule::Depth { .. } => None,
        }
    }

    /// The CoC of the frame that was taken at `time_ns`. Focuses on what `map` has as it was measured, and only then makes
    /// up what it has not.
    pub fn make(&mut self, map: &mut DepthMap, color: &ColorImage, time_ns: u64) -> CocField {
        self.make_noting(map, color, time_ns, |_| ())
    }

    /// The same, which calls `done` after each part, by its name: for benches.
    #[doc(hidden)]
    pub fn make_noting(
        &mut self,
        map: &mut DepthMap,
        color: &ColorImage,
        time_ns: u64,
        mut done: impl FnMut(&'static str),
    ) -> CocField {
        let (lens, range_m, max_coc_px) = match self.rule {
            CocRule::Fixed(field) => return field,
            CocRule::Depth { lens, range_m, max_coc_px, .. } => (lens, range_m, max_coc_px),
        };
        let focus_m = self.focus.focus_m(map, time_ns);
        let field = lens.field((focus_m, range_m), color.width, max_coc_px);
        done("focus");
        // A map that was made around a subject is finished.
        if map.subject_m.is_none() {
            match &mut self.finisher {
                Finisher::Keep => {}
                Finisher::Fill(filler) => filler.fill_guided(map, color),
                Finisher::Refine(refiner) => {
                    refiner.set_focus(focus_m);
                    refiner.refine_on(&mut self.workers, map, color, time_ns);
                    map.is_smooth = false;
                    self.matting.take_from(refiner.on_device());
                }
            }
            done(if matches!(self.finisher, Finisher::Refine(_)) { "refine" } else { "fill" });
            self.cover(map, color, &field);
            self.find_matte(map, color, &field);
            done("matte");
        }
        self.reveal(map, color, &field, Some(time_ns));
        done("memory");
        field
    }

    /// Gives a picture the map of one before it, which several share. Where it was not made around a subject, and has
    /// brought its matte, it needs one of its own.
    pub fn share(&mut self, map: &mut DepthMap, color: &ColorImage, field: &CocField) {
        if map.subject_m.is_some() {
            return;
        }
        self.find_matte(map, color, field);
        self.reveal(map, color, field, None);
    }

    fn find_matte(&mut self, map: &mut DepthMap, color: &ColorImage, field: &CocField) {
        map.matte.pixels.clear();
        if let (CocField::Depth(lens), false) = (field, map.is_smooth) {
            if !std::mem::replace(&mut self.has_matted, true) {
                self.matting = std::mem::take(&mut self.matting).on(self.device.as_ref());
            }
            let Self { matting, workers, .. } = self;
            let jump = lens.inverse_depth_of_px(matting::FROM_PX);
            match &self.background {
                Some(background) => background.find_matte(matting, workers, (map, color), lens),
                None => matting.find_before(workers, (map, color), jump, None),
            }
        }
    }

    /// Looks at what stands before what is remembered, before that is used.
    fn cover(&mut self, map: &DepthMap, color: &ColorImage, field: &CocField) {
        let Self { background, workers, .. } = self;
        if let (CocField::Depth(lens), Some(background), false) = (field, background, map.is_smooth) {
            background.cover(workers, (map, color), lens);
        }
    }

    /// Gives a map what is remembered to lie behind, having learned from it first where it is that of a picture `taken_ns`.
    fn reveal(&mut self, map: &mut DepthMap, color: &ColorImage, field: &CocField, taken_ns: Option<u64>) {
        let Self { background, workers, .. } = self;
        if let (CocField::Depth(lens), Some(background), false) = (field, background, map.is_smooth) {
            if let Some(taken_ns) = taken_ns {
                background.learn(workers, (map, color), lens, taken_ns);
            }
            background.reveal(workers, map, color, lens);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::look::CocAtInfinity;

    #[test]
    fn depth_is_refined_while_that_is_wanted_and_by_one_refiner() {
        let focus = FocusRule::Point { x: 0.5, y: 0.5 };
        let rule = CocRule::Depth { focus, lens: CocAtInfinity::Px(8.0), range_m: 0.0, max_coc_px: 20.0 };
        let mut coc = CocMaker::new(rule, Finish::Fill);
        let mut refiner_after = |refine| {
            coc.follow(rule, Finish::measured(refine));
            match &coc.finisher {
                Finisher::Refine(refiner) => Some(std::ptr::from_ref(&**refiner)),
                Finisher::Fill(_) | Finisher::Keep => None,
            }
        };
        let [none, first, second, last] = [false, true, true, false].map(&mut refiner_after);
        assert_eq!((none, last), (None, None));
        assert!(first.is_some() && first == second, "what it has seen is kept");
    }
}
