//! The time budget: the quality levels, and the governor and planner that choose the level and the depth effort to fit
//! it.

mod governor;
mod load;
mod planner;
mod quality;
mod window;

pub use governor::{Governor, PredictedTimes};
pub use load::{MAX_LEVELS, Sample};
pub use planner::DEADLINE_PERIODS;
pub use planner::{DepthTimes, Plan, Planner};
pub use quality::Quality;
pub use window::Window;
