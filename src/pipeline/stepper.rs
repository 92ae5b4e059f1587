//! Frame after frame on the caller's thread: what a run does to each, for programs that have threads of their own.

use std::mem;

use super::prepare::Preparation;
use super::quality::Picker;
use super::{finest_quality, still};
use crate::bokeh::{self, Bokeh, BokehError};
use crate::budget::Quality;
use crate::clock::Clock;
use crate::computing::{Computing, Executors};
use crate::frame::crop::Cropper;
use crate::frame::{ColorImage, DepthMap};
use crate::look::Look;

/// Blurs the frames of one stream, one at a time. Nothing is allocated once the first frames have passed.
pub struct Stepper {
    size: (u32, u32),
    adaptive: bool,
    preparation: Preparation,
    executors: Executors,
    /// `None` passes frames through.
    executor: Option<Box<dyn Bokeh>>,
    /// What the executor was made for.
    made_for: Option<bokeh::Settings>,
    picker: Picker,
    /// Whether anybody said how long a blur may take.
    is_timed: bool,
    clock: Clock,
    color: ColorImage,
    depth: DepthMap,
    blurred: ColorImage,
    cropper: Cropper,
    /// The part of the picture that goes out.
    cropped: ColorImage,
    remark: Option<String>,
}

impl Stepper {
    /// For pictures of `size` pixels that shall look like `look`, which is [for a source](Look::for_source) like this one.
    /// `measured` as for [`Run`](super::Run). Where the look leaves the quality open and this is `adaptive`, the quality follows
    /// the time there is, once [`Stepper::allow`] has said how much.
    ///
    /// # Errors
    /// The blur is too wide for the pictures, or there is no such GPU.
    pub fn new(
        look: &Look,
        size: (u32, u32),
        measured: bool,
        adaptive: bool,
        computing: Computing,
    ) -> Result<Self, BokehError> {
        let threads = computing.threads();
        let mut executors = Executors::new(computing);
        let made_for = look.settings(size, adaptive);
        let executor = made_for.as_ref().map(|settings| executors.blur(settings, size)).transpose()?;
        let finest = finest_quality(executor.as_deref());
        let mut preparation = Preparation::new(look, (size, None), measured, false, threads);
        preparation.beside(executor.as_deref());
        Ok(Self {
            size,
            adaptive,
            preparation,
            executors,
            executor,
            made_for,
            // Until a time is allowed there is enough.
            picker: Picker::new((look.quality_rule(adaptive), finest), u64::MAX, None, (&[1.0], false)),
            is_timed: false,
            clock: Clock::system(),
            color: ColorImage::new(size.0, size.1),
            depth: DepthMap::default(),
            blurred: ColorImage::new(size.0, size.1),
            cropper: Cropper::default(),
            cropped: ColorImage::default(),
            remark: None,
        })
    }

    /// Blurs the next frames as another look says: the focus moves there as a lens does.
    ///
    /// # Errors
    /// As for [`Stepper::new`]: the look before goes on.
    pub fn follow(&mut self, look: &Look) -> Result<(), BokehError> {
        let made_for = look.settings(self.size, self.adaptive);
        if made_for != self.made_for {
            self.executor = made_for.as_ref().map(|settings| self.executors.blur(settings, self.size)).transpose()?;
            self.made_for = made_for;
            self.picker = self.picker.with(look.quality_rule(self.adaptive), finest_quality(self.executor.as_deref()));
        }
        self.preparation.follow(look, false);
        self.preparation.beside(self.executor.as_deref());
        Ok(())
    }

    /// Another scene comes: nothing is left of those before.
    pub fn forget(&mut self) {
        self.preparation.forget();
    }

    /// A blur may take so long from now on, in nanoseconds.
    pub fn allow(&mut self, budget_ns: u64) {
        self.is_timed = true;
        self.picker.allow(budget_ns);
    }

    /// How long the blur of the next frame is likely to take, in nanoseconds; 0 before anything is known.
    pub fn expected_ns(&self) -> u64 {
        self.picker.expected_ns()
    }

    /// The quality of the next frame; `None` where nothing is blurred.
    pub fn quality(&self) -> Option<Quality> {
        self.executor.as_ref().map(|_| self.picker.quality())
    }

    /// Whether frames need depth.
    pub fn needs_depth(&self) -> bool {
        self.executor.is_some() && self.preparation.fixed().is_none()
    }

    /// Where the next frame's picture goes, and its depth as it was measured: all of both is to be written, before each
    /// [`Stepper::step`].
    pub fn frame(&mut self) -> (&mut ColorImage, &mut DepthMap) {
        (&mut self.color, &mut self.depth)
    }

    /// Blurs the [frame](Stepper::frame) that is at `time_ns` of media time, later than the one before.
    ///
    /// # Errors
    /// The picture has another size, or the executor failed.
    pub fn step(&mut self, time_ns: u64) -> Result<&ColorImage, BokehError> {
        let Some(executor) = &mut self.executor else { return Ok(&self.color) };
        let (field, part) = match self.preparation.fixed() {
            Some(field) => (field, None),
            None => {
                let (field, remark) = self.preparation.make(&mut self.depth, &self.color, time_ns);
                self.remark = remark.or(self.remark.take());
                (field, self.preparation.stage(&mut self.color, &mut self.depth, &field, time_ns))
            }
        };
        let (quality, began_ns) = (self.picker.quality(), self.clock.now_ns());
        let depth = self.preparation.fixed().is_none().then(|| mem::take(&mut self.depth));
        let images = (mem::take(&mut self.color), mem::take(&mut self.blurred));
        let done = still::blur_into(&mut **executor, quality, images, depth, field)?;
        (self.color, self.blurred) = (done.color, done.blurred);
        self.depth = done.depth.unwrap_or_else(|| mem::take(&mut self.depth));
        if self.is_timed {
            let now_ns = self.clock.now_ns();
            self.picker.note(quality, now_ns - began_ns, now_ns);
        }
        Ok(match part {
            None => &self.blurred,
            Some(part) => {
                self.cropper.crop(&self.blurred, &part, &mut self.cropped);
                &self.cropped
            }
        })
    }

    /// What is to be said of the depth, once: that it does not fit the pictures.
    pub fn remark(&mut self) -> Option<String> {
        self.remark.take()
    }
}
