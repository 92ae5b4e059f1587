//! Colour and depth in, blurred picture out: all that is done to a frame, whoever asks for it.
//!
//! A `Preparation` makes a frame ready: what its depth lacks is filled in or refined, the lens is focused, mixed pixels get
//! their matte, and the subject is staged. A [`Blur`] blurs it, as finely as there is time for. In a run each of both has a thread
//! of its own; a [`Stepper`] has both on its caller's, for frame after frame, and [`still`] for a picture on its own.

// What the threads of a run alone ask of it.
#![cfg_attr(not(feature = "files"), allow(dead_code, unused_imports))]

mod blur;
mod coc;
mod fit_check;
mod preparation;
mod quality;
mod staging;
mod stepper;
pub mod still;

pub(crate) use blur::Time;
pub use blur::{Blur, Images};
pub use coc::{CocMaker, Finish};
pub(crate) use preparation::{Input, Origin, Preparation, Staged};
pub(crate) use staging::Taken;
pub use stepper::Stepper;

use crate::look::{Effect, Look};

/// Both halves, made for each other.
pub(crate) struct Engine {
    pub preparation: Preparation,
    pub blur: Blur,
}

impl Engine {
    /// Nothing was seen yet; `blur` blurs as the look says.
    pub fn new(look: &Look, input: Input, blur: Blur) -> Self {
        // Without a blur nobody asks for depth.
        let plain = blur.executor().is_none().then(|| Look::plain(Effect::None));
        let mut preparation = Preparation::new(plain.as_ref().unwrap_or(look), input);
        preparation.beside(blur.executor());
        Self { preparation, blur }
    }
}
