//! Frame after frame on the caller's thread: what a run does to each, for programs that have threads of their own.

use super::{Blur, Engine, Images, Input, Origin};
use crate::bokeh::BokehError;
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
    engine: Engine,
    executors: Executors,
    /// Whether anybody said how long a blur may take.
    is_timed: bool,
    clock: Clock,
    images: Images,
    cropper: Cropper,
    /// The part of the picture that goes out.
    cropped: ColorImage,
}

impl Stepper {
    /// For pictures of `size` pixels that shall look like `look`, which is [for a source](Look::for_source) like this one.
    /// `measured` says whether their depth is, so that refining it makes it better. Where the look leaves the quality open and this is `adaptive`, the quality follows
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
        let depth = if measured { Origin::Measured } else { Origin::Made };
        let input = Input { size, frames: None, depth, knows_background: false, threads: computing.threads() };
        let mut executors = Executors::new(computing);
        // Until a time is allowed there is enough.
        let mut blur = Blur::default();
        blur.follow(look, (size, adaptive), |settings| executors.blur(settings, size))?;
        Ok(Self {
            size,
            adaptive,
            engine: Engine::new(look, input, blur),
            executors,
            is_timed: false,
            clock: Clock::system(),
            images: Images {
                color: ColorImage::new(size.0, size.1),
                depth: Some(DepthMap::default()),
                blurred: ColorImage::new(size.0, size.1),
            },
            cropper: Cropper::default(),
            cropped: ColorImage::default(),
        })
    }

    /// Blurs the next frames as another look says: the focus moves there as a lens does.
    ///
    /// # Errors
    /// As for [`Stepper::new`]: the look before goes on.
    pub fn follow(&mut self, look: &Look) -> Result<(), BokehError> {
        let Self { engine: Engine { preparation, blur }, executors, size, .. } = self;
        blur.follow(look, (*size, self.adaptive), |settings| executors.blur(settings, *size))?;
        preparation.follow(look);
        preparation.beside(blur.executor());
        Ok(())
    }

    /// Another scene comes: nothing is left of those before.
    pub fn forget(&mut self) {
        self.engine.preparation.forget();
    }

    /// A blur may take so long from now on, in nanoseconds.
    pub fn allow(&mut self, budget_ns: u64) {
        self.is_timed = true;
        self.engine.blur.picker.allow(budget_ns);
    }

    /// How long the blur of the next frame is likely to take, in nanoseconds; 0 before anything is known.
    pub fn expected_ns(&self) -> u64 {
        self.engine.blur.picker.expected_ns()
    }

    /// The quality of the next frame; `None` where nothing is blurred.
    pub fn quality(&self) -> Option<Quality> {
        self.engine.blur.quality()
    }

    /// Whether frames need depth.
    pub fn needs_depth(&self) -> bool {
        self.engine.blur.executor().is_some() && self.engine.preparation.fixed().is_none()
    }

    /// Where the next frame's picture goes, and its depth as it was measured: all of both is to be written, before each
    /// [`Stepper::step`].
    pub fn frame(&mut self) -> (&mut ColorImage, &mut DepthMap) {
        (&mut self.images.color, self.images.depth.get_or_insert_default())
    }

    /// Blurs the [frame](Stepper::frame) that is at `time_ns` of media time, later than the one before.
    ///
    /// # Errors
    /// The picture has another size, or the executor failed.
    pub fn step(&mut self, time_ns: u64) -> Result<&ColorImage, BokehError> {
        let Self { engine: Engine { preparation, blur }, images, .. } = self;
        let Some(quality) = blur.quality() else { return Ok(&images.color) };
        let (coc, part) = preparation.prepare(&mut images.color, images.depth.as_mut(), time_ns)?;
        let began_ns = self.clock.now_ns();
        blur.blur(images, coc)?;
        if self.is_timed {
            let now_ns = self.clock.now_ns();
            blur.picker.note(quality, now_ns - began_ns, now_ns);
        }
        blur.has_moved();
        Ok(match part {
            None => &images.blurred,
            Some(part) => {
                self.cropper.crop(&images.blurred, &part, &mut self.cropped);
                &self.cropped
            }
        })
    }

    /// What is to be said of the depth, once: that it does not fit the pictures.
    pub fn remark(&mut self) -> Option<String> {
        self.engine.preparation.remark()
    }
}
