//! The threads of the stages: how they start, and how a panic ends the run.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, Scope, ScopedJoinHandle};

use super::{Ended, Fault};

/// Starts the thread of a stage.
pub(super) fn spawn<'scope>(
    scope: &'scope Scope<'scope, '_>,
    stage: &'static str,
    over: &'scope AtomicBool,
    body: impl FnOnce() -> Ended + Send + 'scope,
) -> Result<ScopedJoinHandle<'scope, Ended>, Fault> {
    let thread = thread::Builder::new().name(stage.into());
    thread.spawn_scoped(scope, move || guard(stage, over, body)).map_err(|cause| Fault::Thread { stage, cause })
}

/// Runs a stage; turns a panic into an error, and signals the end to the capture stage.
pub(super) fn guard(stage: &'static str, over: &AtomicBool, body: impl FnOnce() -> Ended) -> Ended {
    // After a panic only the stage's counts and times are used, which are consistent at every step.
    let ended = std::panic::catch_unwind(std::panic::AssertUnwindSafe(body));
    over.store(true, Ordering::Relaxed);
    ended.unwrap_or_else(|panic| Err(Fault::panic(stage, &*panic)))
}

pub(super) fn join(thread: ScopedJoinHandle<Ended>) -> Ended {
    // The guard catches every panic except one that its own handling raised.
    thread.join().unwrap_or_else(|panic| Err(Fault::panic("upstream", &*panic)))
}
