//! The time budget: the quality ladder, and the governor that picks its rung.

mod governor;
mod quality;
mod window;

pub use governor::{Governor, MAX_RUNGS, Sample};
pub use quality::Quality;
pub use window::Window;
