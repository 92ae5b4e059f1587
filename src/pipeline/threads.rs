//! The threads of the stages: how they start, and what becomes of a panic.

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

/// Runs a stage; makes an error of a panic, and tells capture that the end has come.
pub(super) fn guard(stage: &'static str, over: &AtomicBool, body: impl FnOnce() -> Ended) -> Ended {
    // Nothing of a stage is used after it panicked but its counts and times, which are whole at every step.
    let ended = std::panic::catch_unwind(std::panic::AssertUnwindSafe(body));
    over.store(true, Ordering::Relaxed);
    ended.unwrap_or_else(|panic| Err(Fault::panic(stage, &*panic)))
}

pub(super) fn join(thread: ScopedJoinHandle<Ended>) -> Ended {
    // The guard lets no panic through but one that its own handling raised.
    thread.join().unwrap_or_else(|panic| Err(Fault::panic("upstream", &*panic)))
}
