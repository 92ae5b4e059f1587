//! Networks in a process of their own, whose memory the system limits, and whose time the waiting side limits.
//!
//! No runtime limits the network that it runs: a file of 150 bytes can request 40 GB, which aborts the process, or
//! occupy a thread for hours. Here the process that aborts or is killed is not the one that shows the picture. The
//! program is started again, with [`ARGUMENT`] as its only argument and a socket as standard input, and calls
//! [`serve`].

mod message;
mod process;
mod serve;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

pub use serve::serve;

use super::{LoadFailure, Network, Runtime};
use process::Process;

/// The argument with which the program is started to call [`serve`].
pub const ARGUMENT: &str = "--run-network-apart";

/// Memory limit of the process: several times the need of the largest file with all its pictures.
const MAX_MEMORY_BYTES: u64 = 4 << 30;
/// Time limit for loading a network; a busy machine needs less.
const LOAD_TIMEOUT: Duration = Duration::from_secs(30);
/// Time limit for an answer; a later one would be useless.
const RUN_TIMEOUT: Duration = Duration::from_secs(10);

/// Whether the program supports [`ARGUMENT`].
static IS_ENABLED: AtomicBool = AtomicBool::new(false);
/// Whether the program is about to exit.
static IS_EXITING: AtomicBool = AtomicBool::new(false);

/// Runs unknown networks in separate processes from now on. Only for a program that calls [`serve`] when started with
/// [`ARGUMENT`]; in others, networks can use any amount of memory and time.
pub fn enable() {
    IS_ENABLED.store(true, Ordering::Relaxed);
}

/// Shortens all waits, because the program is about to exit.
pub fn shorten_timeouts() {
    IS_EXITING.store(true, Ordering::Relaxed);
}

pub(super) fn is_enabled() -> bool {
    IS_ENABLED.load(Ordering::Relaxed)
}

/// Starts a process and loads a network in it.
pub(super) fn load(bytes: &[u8], runtime: Runtime) -> Result<Network, LoadFailure> {
    let process =
        Process::start().map_err(|error| LoadFailure::Refused(format!("its process does not start: {error}")))?;
    process.load(bytes, runtime)
}
