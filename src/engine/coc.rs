//! Computes a frame's circle of confusion (CoC) from its depth: the one step that every blur by depth goes through.

use std::sync::Arc;

use crate::compute::thread_pool::ThreadPool;
use crate::compute::{Device, DeviceFrame};
use crate::depth::background::BackgroundMemory;
use crate::depth::fill::HoleFiller;
use crate::depth::focus::{Focus, FocusRule};
use crate::depth::hidden::{HiddenSurfaces, Hiding};
use crate::depth::matting::{self, Matting};
use crate::depth::refine::{MapCorrection, Refiner};
use crate::frame::{ColorImage, DepthMap};
use crate::link::pool::Pooled;
use crate::look::CocRule;
use crate::optics::CocField;

/// How a depth map is postprocessed before it is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Postprocess {
    /// Not at all: it is complete already.
    Keep,
    /// Fills holes.
    Fill,
    /// Aligns it to the picture's edges, smooths it over time, and fills holes.
    Refine,
}

impl Postprocess {
    /// Returns the postprocessing of measured depth.
    pub fn for_measured(refine: bool) -> Self {
        if refine { Self::Refine } else { Self::Fill }
    }
}

/// Applies a [`CocRule`] frame by frame.
pub struct CocCalculator {
    rule: CocRule,
    focus: Focus,
    postprocessor: Postprocessor,
    correction: MapCorrection,
    /// Whether there is only one picture, of which nothing is kept for the next.
    single: bool,
    /// The GPU that refines depth and estimates mattes; `None` is the CPU.
    device: Option<Arc<Device>>,
    matting: Matting,
    /// Whether a matte was estimated since the device was set: the device is only tried once a matte is needed.
    has_estimated_matte: bool,
    background: Option<BackgroundMemory>,
    hidden: HiddenSurfaces,
    workers: ThreadPool,
}

enum Postprocessor {
    Keep,
    Fill(Box<HoleFiller>),
    Refine(Box<Refiner>),
}

impl Postprocessor {
    fn new(
        postprocess: Postprocess,
        (correction, single): (MapCorrection, bool),
        device: Option<&Arc<Device>>,
    ) -> Self {
        match postprocess {
            Postprocess::Keep => Self::Keep,
            Postprocess::Fill => Self::Fill(Box::default()),
            Postprocess::Refine => {
                let refiner = Refiner::with_correction(correction).for_single_pictures(single);
                Self::Refine(Box::new(refiner.with_device(device)))
            }
        }
    }

    fn postprocess(&self) -> Postprocess {
        match self {
            Self::Keep => Postprocess::Keep,
            Self::Fill(_) => Postprocess::Fill,
            Self::Refine(_) => Postprocess::Refine,
        }
    }
}

fn focus_rule(rule: CocRule) -> FocusRule {
    match rule {
        CocRule::Fixed(_) => FocusRule::Auto,
        CocRule::Depth { focus, .. } => focus,
    }
}

impl CocCalculator {
    /// Creates a calculator without history, which works on the caller's thread.
    pub fn new(rule: CocRule, postprocess: Postprocess) -> Self {
        let (focus, correction) = (Focus::new(focus_rule(rule)), MapCorrection::default());
        let (postprocessor, matting) = (Postprocessor::new(postprocess, (correction, false), None), Matting::default());
        Self {
            rule,
            focus,
            postprocessor,
            correction,
            single: false,
            device: None,
            matting,
            has_estimated_matte: false,
            background: None,
            hidden: HiddenSurfaces::default(),
            workers: ThreadPool::new("depth", 1),
        }
    }

    /// Returns whether the focus follows a subject that is detected.
    pub fn focuses_on_subject(&self) -> bool {
        matches!(self.rule, CocRule::Depth { focus: FocusRule::Auto, .. })
    }

    /// Uses `threads` threads, the caller's included; the results are bit-identical.
    pub fn with_threads(self, threads: usize) -> Self {
        Self { workers: ThreadPool::new("depth", threads), ..self }
    }

    /// Processes a single picture if `single`: keeps nothing of it for a next one, which saves memory.
    pub fn for_single_picture(mut self, single: bool) -> Self {
        self.single = single;
        self.reset_postprocessor(self.postprocessor.postprocess());
        self
    }

    /// Refines depth and estimates mattes on `device` from now on. No effect if it is `None` or already in use.
    pub fn use_device(&mut self, device: Option<Arc<Device>>) {
        let is_other = |device: &Arc<Device>| !self.device.as_ref().is_some_and(|own| Arc::ptr_eq(own, device));
        if let Some(device) = device.filter(is_other) {
            self.device = Some(device);
            self.has_estimated_matte = false;
            if matches!(self.postprocessor, Postprocessor::Refine(_)) {
                self.reset_postprocessor(Postprocess::Refine);
            }
        }
    }

    /// Returns what refines depth, for the report; `None` if nothing is refined.
    pub fn refinement_backend(&self) -> Option<&'static str> {
        match (&self.postprocessor, self.rule) {
            (Postprocessor::Refine(refiner), CocRule::Depth { .. }) => Some(refiner.backends()),
            _ => None,
        }
    }

    /// Takes the device's copy of the last map and its picture; `None` if missing, or taken already.
    pub fn take_device_copy(&mut self) -> Option<Pooled<DeviceFrame>> {
        match &mut self.postprocessor {
            Postprocessor::Refine(refiner) => refiner.take_copy(),
            Postprocessor::Keep | Postprocessor::Fill(_) => None,
        }
    }

    /// Returns what estimates mattes, for the report; `None` if none was needed so far.
    pub fn matting_backend(&self) -> Option<&'static str> {
        self.has_estimated_matte.then(|| self.matting.backends())
    }

    /// Replaces the postprocessor by one without history.
    fn reset_postprocessor(&mut self, postprocess: Postprocess) {
        let uses_depth = matches!(self.rule, CocRule::Depth { .. });
        // The old postprocessor's buffers on the device do not belong to the next map.
        self.matting.set_device_frame(None);
        let device = self.device.as_ref().filter(|_| uses_depth);
        self.postprocessor = Postprocessor::new(postprocess, (self.correction, self.single), device);
    }

    /// Sets the correction of misaligned depth edges; returns whether maps are refined, so that it takes effect.
    pub fn set_correction(&mut self, correction: MapCorrection) -> bool {
        let refines = matches!(self.postprocessor, Postprocessor::Refine(_));
        if std::mem::replace(&mut self.correction, correction) != correction && refines {
            self.reset_postprocessor(Postprocess::Refine);
        }
        refines
    }

    /// Sets how maps are postprocessed.
    pub fn set_postprocess(&mut self, postprocess: Postprocess) {
        if self.postprocessor.postprocess() != postprocess {
            self.reset_postprocessor(postprocess);
        }
    }

    /// Enables or disables the background memory (disocclusion filling from earlier frames).
    pub fn set_background_memory(&mut self, remembers: bool) {
        if self.background.is_some() != remembers {
            self.background = remembers.then(BackgroundMemory::default);
        }
    }

    /// Drops all history, because another scene comes.
    pub fn clear_history(&mut self) {
        self.focus = Focus::new(focus_rule(self.rule));
        if let Postprocessor::Refine(refiner) = &mut self.postprocessor {
            refiner.reset();
        }
        self.background = self.background.take().map(|_| BackgroundMemory::default());
    }

    /// Follows another rule; the focus moves on from its present distance.
    pub fn set_rule(&mut self, rule: CocRule, postprocess: Postprocess) {
        match (std::mem::replace(&mut self.rule, rule), rule) {
            (CocRule::Depth { .. }, CocRule::Depth { focus, .. }) => {
                self.focus.set_rule(focus);
                self.set_postprocess(postprocess);
            }
            _ => {
                self.focus = Focus::new(focus_rule(rule));
                self.reset_postprocessor(postprocess);
            }
        }
    }

    /// Returns the CoC of every frame if the rule needs no depth.
    pub fn fixed_coc(&self) -> Option<CocField> {
        match self.rule {
            CocRule::Fixed(field) => Some(field),
            CocRule::Depth { .. } => None,
        }
    }

    /// Computes the CoC of the frame at `time_ns` and finishes `map`. The focus is measured on the raw map, before
    /// holes are filled.
    pub fn compute(&mut self, map: &mut DepthMap, color: &ColorImage, time_ns: u64) -> CocField {
        let (lens, range_m, max_coc_px) = match self.rule {
            CocRule::Fixed(field) => return field,
            CocRule::Depth { lens, range_m, max_coc_px, .. } => (lens, range_m, max_coc_px),
        };
        let focus_m = self.focus.focus_m(map, time_ns);
        let field = lens.coc_field(focus_m, range_m, color.width, max_coc_px);
        // A map made around a subject (`subject_m`) is complete already.
        if map.subject_m.is_none() {
            if !map.metres.iter().any(|&metres| DepthMap::is_known(metres)) {
                // The depth of an earlier frame would leave the room sharp where a person was: all is far.
                map.resize(color.width, color.height);
                map.metres.fill(0.0);
                map.matte.pixels.clear();
                return field;
            }
            match &mut self.postprocessor {
                Postprocessor::Keep => {}
                Postprocessor::Fill(filler) => filler.fill_guided(map, color),
                Postprocessor::Refine(refiner) => {
                    refiner.set_focus(focus_m);
                    refiner.refine_with_workers(&mut self.workers, map, color, time_ns);
                    map.is_smooth = false;
                    self.matting.set_device_frame(refiner.device_frame());
                }
            }
            self.mark_covered_background(map, color, &field);
            self.estimate_matte(map, color, &field);
        }
        // Only now, with the matte known, does the background memory learn from this frame and fill what the subject
        // hides.
        self.fill_hidden_background(map, color, &field, Some(time_ns));
        field
    }

    /// Adapts a depth map of an earlier frame to the picture `color`. A map with a subject brings its own matte; for
    /// any other the matte is estimated from this picture.
    pub fn adapt_reused_map(&mut self, map: &mut DepthMap, color: &ColorImage, field: &CocField) {
        if map.subject_m.is_some() {
            return;
        }
        self.estimate_matte(map, color, field);
        self.fill_hidden_background(map, color, field, None);
    }

    fn estimate_matte(&mut self, map: &mut DepthMap, color: &ColorImage, field: &CocField) {
        map.matte.pixels.clear();
        if let (CocField::Depth(lens), false) = (field, map.is_smooth) {
            if !std::mem::replace(&mut self.has_estimated_matte, true) {
                self.matting = std::mem::take(&mut self.matting).with_device(self.device.as_ref());
            }
            let Self { matting, workers, .. } = self;
            let depth_step = lens.inverse_depth_step(matting::MIN_STEP_PX);
            match &self.background {
                Some(background) => background.find_matte(matting, workers, (map, color), lens),
                None => matting.find_with_background(workers, (map, color), depth_step, None),
            }
        }
    }

    /// Notes which part of the remembered background is covered in this frame, before the memory is used.
    fn mark_covered_background(&mut self, map: &DepthMap, color: &ColorImage, field: &CocField) {
        let Self { background, workers, .. } = self;
        if let (CocField::Depth(lens), Some(background), false) = (field, background, map.is_smooth) {
            background.update_covering(workers, (map, color), lens);
        }
    }

    /// Adds what the surfaces of a map hide to its matte: from memory; otherwise by an estimate behind near things, and in a
    /// single picture behind the subject. If `taken_ns` is given, the memory first learns from this frame.
    fn fill_hidden_background(
        &mut self,
        map: &mut DepthMap,
        color: &ColorImage,
        field: &CocField,
        taken_ns: Option<u64>,
    ) {
        let Self { background, hidden, workers, single, postprocessor, .. } = self;
        let (CocField::Depth(lens), false) = (field, map.is_smooth) else { return };
        if let Some(background) = background {
            if let Some(taken_ns) = taken_ns {
                background.update(workers, (map, color), lens, taken_ns);
            }
            background.reveal_background(workers, map, color, lens);
        }
        hidden.add_to_matte(workers, map, color, lens, Hiding::NEAR);
        // A stream has its memory for what the subject hides, and no time; a map that is complete was blurred in one before;
        // and a mask has one distance for all that is behind.
        if *single && map.subject_m.is_none() && !matches!(postprocessor, Postprocessor::Keep) {
            hidden.add_to_matte(workers, map, color, lens, Hiding::SUBJECT);
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
        let mut coc = CocCalculator::new(rule, Postprocess::Fill);
        let mut refiner_after = |refine| {
            coc.set_rule(rule, Postprocess::for_measured(refine));
            match &coc.postprocessor {
                Postprocessor::Refine(refiner) => Some(std::ptr::from_ref(&**refiner)),
                Postprocessor::Fill(_) | Postprocessor::Keep => None,
            }
        };
        let [none, first, second, last] = [false, true, true, false].map(&mut refiner_after);
        assert_eq!((none, last), (None, None));
        assert!(first.is_some() && first == second, "what it has seen is kept");
    }
}
