//! The matchers under test.

#[path = "stand_in.rs"]
mod stand_in;

use bokehcam::depth::stereo::{Effort, Matcher};

use super::Outcome;
use super::options::Options;

/// A matcher of pictures of this size that remembers no frame.
///
/// # Errors
/// It cannot be made.
pub fn create(
    options: &Options,
    effort: Effort,
    disparities: u32,
    _size: (u32, u32),
    _threads: Option<usize>,
) -> Outcome<Box<dyn Matcher>> {
    let mut matcher = stand_in::StandIn { disparities };
    matcher.set_effort(effort);
    let _ = &options.gpu;
    Ok(Box::new(matcher))
}
