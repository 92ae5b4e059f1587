//! How another thread wakes PipeWire's loop: a counter of the kernel's, without a lock or memory of ours.

use std::io;
use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::time::Duration;

use rustix::event::{EventfdFlags, PollFd, PollFlags, Timespec, eventfd, poll};

/// Wakes the loop that polls [`Waker::descriptor`]. Clones wake the same one.
#[derive(Clone, Debug)]
pub struct Waker(Arc<OwnedFd>);

impl Waker {
    pub fn new() -> io::Result<Self> {
        Ok(Self(Arc::new(eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?)))
    }

    /// Wakes the loop. Never waits; what was done before is seen by who is woken.
    pub fn wake(&self) {
        // It fails only where 2^64 wakes were not heard yet.
        let _ = rustix::io::write(&*self.0, &1_u64.to_ne_bytes());
    }

    /// Silences what was rung until now.
    pub fn silence(&self) {
        let mut rung = [0; 8];
        // It fails only where there was nothing to silence.
        let _ = rustix::io::read(&*self.0, &mut rung);
    }

    /// Sleeps until it is rung, but no longer than `patience`, and silences it.
    pub fn wait(&self, patience: Duration) {
        let patience = Timespec::try_from(patience).ok();
        // Rung or not, the caller looks again.
        let _ = poll(&mut [PollFd::new(&*self.0, PollFlags::IN)], patience.as_ref());
        self.silence();
    }

    /// Another descriptor of the counter: readable once it was rung.
    pub fn descriptor(&self) -> io::Result<OwnedFd> {
        self.0.try_clone()
    }
}
