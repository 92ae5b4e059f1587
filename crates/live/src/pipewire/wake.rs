//! Wakes PipeWire's loop from another thread through an eventfd, without locks or allocations.

use std::io;
use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::time::Duration;

use rustix::event::{EventfdFlags, PollFd, PollFlags, Timespec, eventfd, poll};

/// Wakes the loop that polls [`Waker::descriptor`]. Clones share one eventfd.
#[derive(Clone, Debug)]
pub struct Waker(Arc<OwnedFd>);

impl Waker {
    pub fn new() -> io::Result<Self> {
        Ok(Self(Arc::new(eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?)))
    }

    /// Wakes the loop. Never blocks; earlier writes of the caller are visible to the woken thread.
    pub fn wake(&self) {
        // Fails only if 2^64 wakes are pending.
        let _ = rustix::io::write(&*self.0, &1_u64.to_ne_bytes());
    }

    /// Clears pending wakes.
    pub fn clear(&self) {
        let mut pending = [0; 8];
        // Fails only if nothing is pending.
        let _ = rustix::io::read(&*self.0, &mut pending);
    }

    /// Waits for a wake, for at most `timeout`, and clears it.
    pub fn wait(&self, timeout: Duration) {
        let timeout = Timespec::try_from(timeout).ok();
        // The caller checks its state in either case.
        let _ = poll(&mut [PollFd::new(&*self.0, PollFlags::IN)], timeout.as_ref());
        self.clear();
    }

    /// Returns another descriptor of the eventfd, which is readable while a wake is pending.
    pub fn descriptor(&self) -> io::Result<OwnedFd> {
        self.0.try_clone()
    }
}
