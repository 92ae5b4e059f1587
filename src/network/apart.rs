//! Networks in a process of their own, which is bounded: in memory by the system, in time by who waits for its answers.
//!
//! No runtime bounds what it runs: a file of 150 bytes can ask for 40 GB, which aborts a process, or keep a thread at work for
//! hours. Here the process that aborts or is killed is not the one that shows the picture. The program is started once more,
//! with [`ARGUMENT`] alone and a socket in place of its standard input, and calls [`serve`] for it.

mod message;
mod process;
mod serve;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

pub use serve::serve;

use super::{Failure, Network, Runtime};
use process::Process;

/// What the program is started with, alone, to call [`serve`].
pub const ARGUMENT: &str = "--run-network-apart";

/// Most bytes of memory that the process may ask for: some times what the largest file takes with all its pictures.
const MOST_BYTES: u64 = 4 << 30;
/// A network is loaded in less, also on a machine that is busy with other things.
const LOADING: Duration = Duration::from_secs(30);
/// An answer that takes longer is of no use.
const ANSWERING: Duration = Duration::from_secs(10);

/// Whether the program calls [`serve`] when it is told to.
static IS_POSSIBLE: AtomicBool = AtomicBool::new(false);
/// Whether the program is about to end.
static ENDS: AtomicBool = AtomicBool::new(false);

/// From now on networks that are not known run in processes of their own: for a program that calls [`serve`] where it is
/// started with [`ARGUMENT`]. In all others, networks can take all the memory and time there is.
pub fn make_possible() {
    IS_POSSIBLE.store(true, Ordering::Relaxed);
}

/// The program is about to end: an answer that is not there soon is waited for no longer.
pub fn hurry() {
    ENDS.store(true, Ordering::Relaxed);
}

pub(super) fn is_possible() -> bool {
    IS_POSSIBLE.load(Ordering::Relaxed)
}

/// Lets a process of its own load a network, and run it from then on.
pub(super) fn load(bytes: &[u8], runtime: Runtime) -> Result<Network, Failure> {
    let process = Process::start().map_err(|error| Failure::Refused(format!("its process does not start: {error}")))?;
    process.load(bytes, runtime)
}
