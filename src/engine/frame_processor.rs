//! Blurs frame by frame on the caller's thread: what a run does to each frame, for programs with their own threads.

use super::{Blur, Engine, Images, Input, Origin, Playback};
use crate::bokeh::BokehError;
use crate::budget::Quality;
use crate::clock::Clock;
use crate::computing::{ComputeOptions, ExecutorFactory};
use crate::depth::backdrop::Background;
use crate::frame::crop::Cropper;
use crate::frame::{ColorImage, DepthMap};
use crate::look::Look;

/// Blurs the frames of one stream, one at a time. Allocates nothing once the first frames have passed.
pub struct FrameProcessor {
    size: (u32, u32),
    adaptive: bool,
    engine: Engine,
    executors: ExecutorFactory,
    /// Whether a time budget is set.
    is_timed: bool,
    clock: Clock,
    images: Images,
    cropper: Cropper,
    /// The crop that goes out.
    cropped: ColorImage,
}

impl FrameProcessor {
    /// Creates a processor for pictures of `size` pixels. `look` must be adapted to the source ([`Look::for_source`]);
    /// `measured` says whether depth is measured, so that refinement improves it. If the look leaves the quality open
    /// and `adaptive` is set, the quality follows the budget given to [`FrameProcessor::set_budget`].
    ///
    /// # Errors
    /// The blur is too wide for the pictures, or the requested GPU does not exist.
    pub fn new(
        look: &Look,
        size: (u32, u32),
        measured: bool,
        adaptive: bool,
        computing: ComputeOptions,
    ) -> Result<Self, BokehError> {
        let depth = if measured { Origin::Measured } else { Origin::Synthesized };
        reject_transparency(look)?;
        let (playback, threads) = (Playback::EveryPicture, computing.thread_count());
        let input = Input { size, frames: None, depth, knows_background: false, playback, threads };
        let mut executors = ExecutorFactory::new(computing);
        // Until a budget is set, time is unlimited.
        let mut blur = Blur::default();
        blur.set_look(look, (size, adaptive), |settings| executors.create_blur(settings, size))?;
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

    /// Blurs the next frames in another look; the focus moves smoothly, like a lens.
    ///
    /// # Errors
    /// Same as for [`FrameProcessor::new`]; the current look stays in use.
    pub fn set_look(&mut self, look: &Look) -> Result<(), BokehError> {
        reject_transparency(look)?;
        let Self { engine: Engine { preprocessor, blur }, executors, size, .. } = self;
        blur.set_look(look, (*size, self.adaptive), |settings| executors.create_blur(settings, *size))?;
        preprocessor.set_look(look);
        preprocessor.use_blur_device(blur.executor());
        Ok(())
    }

    /// Drops all history, because another scene comes.
    pub fn clear_history(&mut self) {
        self.engine.preprocessor.clear_history();
    }

    /// Sets the time that a blur may take, in nanoseconds.
    pub fn set_budget(&mut self, budget_ns: u64) {
        self.is_timed = true;
        self.engine.blur.picker.set_budget(budget_ns);
    }

    /// Returns the expected blur time of the next frame in nanoseconds; 0 if unknown.
    pub fn expected_blur_ns(&self) -> u64 {
        self.engine.blur.picker.expected_blur_ns()
    }

    /// Returns the quality of the next frame; `None` if nothing is blurred.
    pub fn quality(&self) -> Option<Quality> {
        self.engine.blur.quality()
    }

    /// Returns whether frames need depth.
    pub fn needs_depth(&self) -> bool {
        self.engine.blur.executor().is_some() && self.engine.preprocessor.fixed_coc().is_none()
    }

    /// Returns the buffers for the next picture and its raw depth. Both must be written completely before each
    /// [`FrameProcessor::process`].
    pub fn frame_buffers(&mut self) -> (&mut ColorImage, &mut DepthMap) {
        (&mut self.images.color, self.images.depth.get_or_insert_default())
    }

    /// Blurs the [frame](FrameProcessor::frame_buffers) at media time `time_ns`, which must increase.
    ///
    /// # Errors
    /// The picture has another size, or the executor failed.
    pub fn process(&mut self, time_ns: u64) -> Result<&ColorImage, BokehError> {
        let Self { engine: Engine { preprocessor, blur }, images, .. } = self;
        let Some(quality) = blur.quality() else { return Ok(&images.color) };
        let (coc, composed) = preprocessor.preprocess(&mut images.color, images.depth.as_mut(), time_ns)?;
        let began_ns = self.clock.now_ns();
        blur.blur(images, coc)?;
        if self.is_timed {
            let now_ns = self.clock.now_ns();
            blur.picker.record_blur(quality, now_ns - began_ns, now_ns);
        }
        blur.has_changed_backend();
        Ok(match composed.crop {
            None => &images.blurred,
            Some(crop) => {
                self.cropper.crop(&images.blurred, &crop, &mut self.cropped);
                &self.cropped
            }
        })
    }

    /// Takes the pending warning that the depth does not fit the pictures, if any.
    pub fn take_warning(&mut self) -> Option<String> {
        self.engine.preprocessor.take_warning()
    }
}

/// Refuses a look whose results have an alpha channel: frames are returned as colours only.
pub(super) fn reject_transparency(look: &Look) -> Result<(), BokehError> {
    if look.background == Background::Transparent { Err(BokehError::Transparent) } else { Ok(()) }
}
