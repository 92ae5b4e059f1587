//! The engine: colour and depth in, blurred picture out, for every caller.
//!
//! A `Preprocessor` preprocesses a frame: it fills or refines depth, focuses the lens, estimates the matte, and
//! applies virtual background and auto-framing. A [`Blur`] blurs it, as finely as time allows. In a run each of them
//! has its own thread; a [`FrameProcessor`] runs both on the caller's thread, frame by frame, and [`still`] does so for a
//! single picture.

mod backdrop_player;
mod blur;
mod coc;
mod composer;
mod fit_check;
mod frame_processor;
mod preprocessor;
mod quality;
pub mod still;

pub use blur::TimeBudget;
pub use blur::{Blur, Images};
pub use coc::{CocCalculator, Postprocess};
pub use composer::{OriginalFrame, Playback};
pub use frame_processor::FrameProcessor;
pub use preprocessor::{Composed, Input, Origin, Preprocessor};

use crate::look::{Effect, Look};

/// Both halves of the engine, on the same device.
pub struct Engine {
    /// Its first half.
    pub preprocessor: Preprocessor,
    /// Its second half.
    pub blur: Blur,
}

impl Engine {
    /// Creates the engine; `blur` has the executor for the look.
    pub fn new(look: &Look, input: Input, blur: Blur) -> Self {
        // Without a blur no depth is needed.
        let plain = blur.executor().is_none().then(|| Look::with_effect(Effect::None));
        let mut preprocessor = Preprocessor::new(plain.as_ref().unwrap_or(look), input);
        preprocessor.use_blur_device(blur.executor());
        Self { preprocessor, blur }
    }
}
