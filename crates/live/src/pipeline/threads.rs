//! The threads of the stages: how they start, and how a panic ends the run.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, Scope, ScopedJoinHandle};

use super::{Fault, StageResult};

/// Starts the thread of a stage.
pub(super) fn spawn_stage<'scope>(
    scope: &'scope Scope<'scope, '_>,
    stage: &'static str,
    has_ended: &'scope AtomicBool,
    body: impl FnOnce() -> StageResult + Send + 'scope,
) -> Result<ScopedJoinHandle<'scope, StageResult>, Fault> {
    let thread = thread::Builder::new().name(stage.into());
    thread
        .spawn_scoped(scope, move || run_guarded(stage, has_ended, body))
        .map_err(|cause| Fault::Thread { stage, cause })
}

/// Runs a stage; turns a panic into an error, and signals the end to the capture stage.
pub(super) fn run_guarded(
    stage: &'static str,
    has_ended: &AtomicBool,
    body: impl FnOnce() -> StageResult,
) -> StageResult {
    // After a panic only the stage's counts and times are used, which are consistent at every step.
    let ended = std::panic::catch_unwind(std::panic::AssertUnwindSafe(body));
    has_ended.store(true, Ordering::Relaxed);
    ended.unwrap_or_else(|panic| Err(Fault::from_panic(stage, &*panic)))
}

pub(super) fn join_stage(thread: ScopedJoinHandle<StageResult>) -> StageResult {
    // The guard catches every panic except one that its own handling raised.
    thread.join().unwrap_or_else(|panic| Err(Fault::from_panic("upstream", &*panic)))
}
