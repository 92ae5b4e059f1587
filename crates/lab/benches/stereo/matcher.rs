//! The matchers under test.

use bokehcam::compute::Backend;
use bokehcam::compute::thread_pool::core_count;
use bokehcam::depth::stereo::{self, Effort, Matcher, Settings};

use super::Outcome;
use super::options::Options;

/// Creates a matcher of pictures of this size without memory; `threads` of the CPU, all cores when `None`.
///
/// # Errors
/// Fails if the matcher cannot be created.
pub fn create_matcher(
    options: &Options,
    effort: Effort,
    disparities: u32,
    size: (u32, u32),
    threads: Option<usize>,
) -> Outcome<Box<dyn Matcher>> {
    let (backend, adapter) = match options.gpu.as_deref() {
        None => (Backend::Cpu, None),
        Some("") => (Backend::Gpu, None),
        Some(name) => (Backend::Gpu, Some(name)),
    };
    let threads = threads.unwrap_or_else(core_count);
    Ok(stereo::create(&Settings { size, disparities, effort, threads }, backend, adapter)?)
}
