//! Wakes PipeWire's loop from another thread through an eventfd, without locks or allocations.

use std::io;
use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use rustix::event::{EventfdFlags, PollFd, PollFlags, Timespec, eventfd, poll};

use super::{PipeWireError, Result};

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

/// A thread that sleeps on a waker; it is ended on drop.
#[derive(Debug)]
pub struct WokenThread {
    pub waker: Waker,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl WokenThread {
    /// Starts a thread with this name. It has to return when it is woken with the flag set.
    ///
    /// # Errors
    /// The system refuses the thread, or its eventfd.
    pub fn start(name: &str, run: impl FnOnce(&Waker, &AtomicBool) + Send + 'static) -> Result<Self> {
        let (waker, stop) = (Waker::new().map_err(PipeWireError::Thread)?, Arc::<AtomicBool>::default());
        let (waker_handle, end) = (waker.clone(), Arc::clone(&stop));
        let thread = thread::Builder::new().name(name.into()).spawn(move || run(&waker_handle, &end));
        Ok(Self { waker, stop, thread: Some(thread.map_err(PipeWireError::Thread)?) })
    }
}

impl Drop for WokenThread {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        self.waker.wake();
        // A panic of the thread was printed already.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}
