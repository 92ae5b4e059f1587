//! The first half of the engine: computes CoC and matte from a frame's raw depth, then applies virtual background
//! and auto-framing.

use super::Images;
use super::coc::{CocCalculator, Postprocess};
use super::composer::{Composer, OriginalFrame, Playback};
use super::fit_check::{FitCheck, Verdict};
use crate::bokeh::{Bokeh, BokehError};
use crate::compute::DeviceFrame;
use crate::depth::refine::ExactnessDetector;
use crate::frame::crop::Crop;
use crate::frame::{ColorImage, DepthMap};
use crate::link::pool::{Pool, Pooled};
use crate::look::{BackgroundMemory, Look, Refine};
use crate::optics::CocField;

/// Text of the report if refinement stopped because depth turned out to be exact.
const EXACT_DEPTH_NOTE: &str = "none, as depth is exact";

/// Where depth comes from, which decides how it is postprocessed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// It is complete already.
    Finished,
    /// It belongs to a single picture and its origin is unknown: if the look leaves it open, it is refined only if it
    /// does not fit the picture.
    Single,
    /// It was synthesised or inferred: refinement does not improve it.
    Synthesized,
    /// It was measured: refinement improves it, unless it turns out to be exact.
    Measured,
}

impl Origin {
    /// Returns the postprocessing that `look` asks for.
    fn postprocess(self, look: &Look) -> Postprocess {
        match self {
            Self::Finished => Postprocess::Keep,
            Self::Single | Self::Synthesized => Postprocess::for_measured(look.refines_depth(false)),
            Self::Measured => Postprocess::for_measured(look.refines_depth(true)),
        }
    }
}

/// Properties of the incoming frames.
#[derive(Clone, Copy, Debug)]
pub struct Input {
    /// Width and height of the pictures, in pixels.
    pub size: (u32, u32),
    /// The number of frames, if known.
    pub frames: Option<u64>,
    /// The origin of their depth.
    pub depth: Origin,
    /// Whether the depth source provides the background behind the nearer surface, so that none is remembered.
    pub knows_background: bool,
    /// How a video behind the subject is played.
    pub playback: Playback,
    /// Number of worker threads, the caller's included; the results are bit-identical.
    pub threads: usize,
}

/// The result of virtual background and auto-framing.
#[derive(Default)]
pub struct Composed {
    /// The crop to show; `None` is the whole picture.
    pub crop: Option<Crop>,
    /// The frame before its background was replaced, if it was and the original is kept.
    pub original: Option<Pooled<OriginalFrame>>,
    /// What is kept of the frame, over nothing, if its result has an alpha channel: to be blurred like the frame
    /// ([`VirtualBackground::draw_kept`](crate::depth::backdrop::VirtualBackground::draw_kept)).
    pub kept: Option<Pooled<Images>>,
    /// The device's copy of picture and depth, if the device has refined the depth.
    pub on_device: Option<Pooled<DeviceFrame>>,
}

/// Preprocesses frames one after another.
pub struct Preprocessor {
    input: Input,
    /// The postprocessing that the look asks for.
    postprocess: Postprocess,
    coc: CocCalculator,
    /// Detects exact depth, which is refined only on request; `None` if the look decides that.
    exactness: Option<ExactnessDetector>,
    composer: Composer,
    /// Detects depth that does not fit the pictures; `None` if the result would not be used.
    check: Option<FitCheck>,
    /// A pending warning about the depth.
    warning: Option<String>,
}

impl Preprocessor {
    /// Creates the preprocessor for `look`.
    pub fn new(look: &Look, input: Input) -> Self {
        let postprocess = input.depth.postprocess(look);
        let checks = match input.depth {
            Origin::Finished => false,
            Origin::Single => look.refine != Refine::Off,
            Origin::Synthesized | Origin::Measured => true,
        };
        let coc = CocCalculator::new(look.coc_rule(input.size), postprocess).with_threads(input.threads);
        let mut new = Self {
            input,
            postprocess,
            coc: coc.for_single_picture(input.frames == Some(1)),
            exactness: create_exactness_detector(look, postprocess),
            composer: Composer::new(look, input.playback),
            check: checks.then(|| FitCheck::new(input.frames)),
            warning: None,
        };
        new.coc.set_background_memory(new.uses_background_memory(look));
        new
    }

    /// Follows another look.
    pub fn set_look(&mut self, look: &Look) {
        self.postprocess = self.input.depth.postprocess(look);
        self.exactness =
            create_exactness_detector(look, self.postprocess).map(|new| self.exactness.take().unwrap_or(new));
        self.coc.set_rule(look.coc_rule(self.input.size), self.current_postprocess());
        self.coc.set_background_memory(self.uses_background_memory(look));
        self.composer.set_look(look);
    }

    /// Returns whether the hidden background is remembered from frame to frame.
    fn uses_background_memory(&self, look: &Look) -> bool {
        let is_stream = matches!(self.input.depth, Origin::Synthesized | Origin::Measured);
        is_stream && look.background_memory == BackgroundMemory::On && !self.input.knows_background
    }

    /// Refines depth and estimates mattes on the blur's device ([`CocCalculator::use_device`]).
    pub fn use_blur_device(&mut self, bokeh: Option<&dyn Bokeh>) {
        self.coc.use_device(bokeh.and_then(Bokeh::device));
    }

    /// Returns the postprocessing to use now: exact depth is aligned already, and refinement would erase thin
    /// structures.
    fn current_postprocess(&self) -> Postprocess {
        let is_aligned = self.check.as_ref().is_some_and(FitCheck::is_aligned);
        let is_exact = self.exactness.as_ref().is_some_and(ExactnessDetector::is_exact) && is_aligned;
        if is_exact { Postprocess::Fill } else { self.postprocess }
    }

    /// Returns what refines depth ([`CocCalculator::refinement_backend`]), or why refinement stopped, for the report.
    pub fn refinement_backend(&self) -> Option<&'static str> {
        let is_left_alone = self.postprocess == Postprocess::Refine && self.current_postprocess() == Postprocess::Fill;
        if is_left_alone { Some(EXACT_DEPTH_NOTE) } else { self.coc.refinement_backend() }
    }

    /// Returns what estimates mattes ([`CocCalculator::matting_backend`]).
    pub fn matting_backend(&self) -> Option<&'static str> {
        self.coc.matting_backend()
    }

    /// Takes the pending warning that the depth does not fit the pictures, if any.
    pub fn take_warning(&mut self) -> Option<String> {
        self.warning.take()
    }

    /// Drops all history, because another scene comes.
    pub fn clear_history(&mut self) {
        self.exactness.iter_mut().for_each(ExactnessDetector::reset);
        self.coc.clear_history();
    }

    /// Returns whether the focus follows a detected subject ([`CocCalculator::focuses_on_subject`]).
    pub fn focuses_on_subject(&self) -> bool {
        self.coc.focuses_on_subject()
    }

    /// Returns the CoC of every frame if it needs no depth.
    pub fn fixed_coc(&self) -> Option<CocField> {
        self.coc.fixed_coc()
    }

    /// Computes the CoC of the frame at `time_ns`; finishes its `map`.
    pub fn compute_coc(&mut self, map: &mut DepthMap, color: &ColorImage, time_ns: u64) -> CocField {
        // A map that was made around a subject was made from this picture.
        let check = self.check.as_mut().filter(|_| map.subject_m.is_none());
        match check.and_then(|check| check.check_frame(map, color)) {
            None => {}
            Some(Verdict::Unregistered) => {
                self.warning = Some(
                    "none of the outlines of its depth match those of its pictures: the depth may be of another \
                     camera, not registered to the colours (--depth-calibration), or of another time"
                        .to_owned(),
                );
            }
            Some(Verdict::Misaligned(misalignment, correction)) => {
                if self.coc.set_correction(correction) {
                    let line = format!(
                        "depth is aligned with the pictures, as {misalignment}; --refine off uses it unchanged"
                    );
                    self.warning = Some(line);
                } else if self.input.depth == Origin::Single {
                    self.postprocess = Postprocess::Refine;
                    self.coc.set_postprocess(Postprocess::Refine);
                }
            }
        }
        if let Some(exactness) = &mut self.exactness {
            exactness.add_frame(map, color);
            self.coc.set_postprocess(self.current_postprocess());
        }
        self.coc.compute(map, color, time_ns)
    }

    /// Adapts a depth map of an earlier frame to this picture ([`CocCalculator::adapt_reused_map`]).
    pub fn adapt_reused_map(&mut self, map: &mut DepthMap, color: &ColorImage, field: &CocField) {
        self.coc.adapt_reused_map(map, color, field);
    }

    /// Replaces the background behind the subject of a picture whose depth is finished (`Composer::compose`). If that
    /// changes the frame and `originals` is given, the original is kept in one of its buffers. `kept_parts` has buffers for
    /// results with an alpha channel.
    pub fn compose(
        &mut self,
        color: &mut ColorImage,
        map: &mut DepthMap,
        field: &CocField,
        time_ns: u64,
        originals: Option<&Pool<OriginalFrame>>,
        kept_parts: impl FnOnce() -> Pooled<Images>,
    ) -> Composed {
        let replaces = self.composer.replaces_background(field);
        let original = originals.filter(|_| replaces).map(|pool| {
            let mut original = pool.take();
            original.copy_from(color, map);
            original
        });
        // The device's copy is of the original picture: useless once the background is replaced.
        let on_device = self.coc.take_device_copy().filter(|_| !replaces);
        let kept = (replaces && self.composer.is_transparent()).then(|| {
            let mut kept = kept_parts();
            self.composer.draw_kept(color.size(), map, field, &mut kept);
            kept
        });
        Composed { crop: self.composer.compose(color, map, field, time_ns), original, kept, on_device }
    }

    /// Runs all steps for the frame at `time_ns`; returns its CoC and how it was composed.
    ///
    /// # Errors
    /// [`BokehError::NoDepth`] if the CoC follows depth and there is no map.
    pub fn preprocess(
        &mut self,
        color: &mut ColorImage,
        map: Option<&mut DepthMap>,
        time_ns: u64,
    ) -> Result<(CocField, Composed), BokehError> {
        if let Some(field) = self.fixed_coc() {
            return Ok((field, Composed::default()));
        }
        let map = map.ok_or(BokehError::NoDepth)?;
        let field = self.compute_coc(map, color, time_ns);
        let composed = self.compose(color, map, &field, time_ns, None, || Pooled::detached(Images::default()));
        Ok((field, composed))
    }
}

/// Creates the detector of exact depth if depth is refined by default, not on request.
fn create_exactness_detector(look: &Look, postprocess: Postprocess) -> Option<ExactnessDetector> {
    (look.refine == Refine::Auto && postprocess == Postprocess::Refine).then(ExactnessDetector::default)
}

#[cfg(test)]
mod tests;
