//! The time budget: the quality ladder, and what picks its rung and how depth is made, by the time there is.

mod governor;
mod load;
mod planner;
mod quality;
mod window;

pub use governor::{Governor, Times};
pub use load::{MAX_RUNGS, Sample};
#[cfg(feature = "files")]
pub(crate) use planner::DEADLINE_PERIODS;
pub use planner::{DepthTimes, Plan, Planner};
pub use quality::Quality;
pub use window::Window;
