//! A memory limit for the threads that run untrusted work.
//!
//! A failed request for memory aborts a program, and an allocator must not panic. So a request beyond the limit is never
//! answered: the thread sleeps for good, and its caller, who must not wait for it blindly, asks
//! [`MemoryLimit::is_exceeded`].
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicBool, AtomicIsize, Ordering};
use std::thread;
use std::time::Duration;

/// Smaller requests are always granted, as the standard library makes them while it holds locks.
const MIN_CHECKED_BYTES: usize = 64 << 10;

thread_local! {
    static OF_THREAD: Cell<Option<&'static MemoryLimit>> = const { Cell::new(None) };
}

/// How much memory some threads may request together. It has effect in programs whose allocator is [`LimitedAllocator`].
pub struct MemoryLimit {
    max_bytes: usize,
    /// Memory requested minus memory returned by the threads; another thread may return what they requested.
    used_bytes: AtomicIsize,
    is_exceeded: AtomicBool,
    is_stopped: AtomicBool,
}

impl MemoryLimit {
    /// Creates a limit, which is never freed, because a sleeping thread may refer to it.
    pub fn new(max_bytes: usize) -> &'static Self {
        Box::leak(Box::new(Self {
            max_bytes,
            used_bytes: AtomicIsize::new(0),
            is_exceeded: AtomicBool::new(false),
            is_stopped: AtomicBool::new(false),
        }))
    }

    /// Returns the limit of this thread.
    pub fn of_thread() -> Option<&'static Self> {
        OF_THREAD.get()
    }

    /// Limits this thread from now on.
    pub fn apply(&'static self) {
        OF_THREAD.set(Some(self));
    }

    /// Forgets what was requested so far.
    pub fn restart(&self) {
        self.used_bytes.store(0, Ordering::Relaxed);
    }

    /// Lets the threads sleep for good at their next large request.
    pub fn stop(&self) {
        self.is_stopped.store(true, Ordering::Relaxed);
    }

    /// Whether a thread requested too much, and sleeps.
    pub fn is_exceeded(&self) -> bool {
        self.is_exceeded.load(Ordering::Relaxed)
    }

    /// Counts a request; does not return if it is too much.
    pub fn add(&self, bytes: usize) {
        let added = isize::try_from(bytes).unwrap_or(isize::MAX);
        let used = self.used_bytes.fetch_add(added, Ordering::Relaxed).saturating_add(added);
        let is_too_much = bytes > self.max_bytes || usize::try_from(used).is_ok_and(|used| used > self.max_bytes);
        if bytes >= MIN_CHECKED_BYTES && (is_too_much || self.is_stopped.load(Ordering::Relaxed)) {
            self.sleep();
        }
    }

    fn sleep(&self) -> ! {
        self.is_exceeded.store(true, Ordering::Relaxed);
        loop {
            thread::sleep(Duration::from_secs(3600));
        }
    }
}

/// The system's allocator, which keeps each thread within its [`MemoryLimit`].
pub struct LimitedAllocator;

/// Makes a request within the limit of this thread, if it has one.
fn request(bytes: usize, make: impl FnOnce() -> *mut u8) -> *mut u8 {
    let Some(limit) = OF_THREAD.get() else { return make() };
    limit.add(bytes);
    let memory = make();
    // The system has not so much.
    if memory.is_null() { limit.sleep() } else { memory }
}

fn give_back(bytes: usize) {
    if let Some(limit) = OF_THREAD.get() {
        limit.used_bytes.fetch_sub(isize::try_from(bytes).unwrap_or(isize::MAX), Ordering::Relaxed);
    }
}

// SAFETY: every call is forwarded to the system's allocator, or never returns; the counters do not allocate, and are not
// dropped with their thread.
unsafe impl GlobalAlloc for LimitedAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller upholds the contract of the forwarded call.
        request(layout.size(), || unsafe { System.alloc(layout) })
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller upholds the contract of the forwarded call.
        request(layout.size(), || unsafe { System.alloc_zeroed(layout) })
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        give_back(layout.size());
        // SAFETY: the caller upholds the contract of the forwarded call.
        unsafe { System.dealloc(memory, layout) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: the caller upholds the contract of the forwarded call.
        let moved = request(size, || unsafe { System.realloc(memory, layout, size) });
        give_back(layout.size());
        moved
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[global_allocator]
    static ALLOCATOR: LimitedAllocator = LimitedAllocator;

    #[test]
    fn what_is_returned_can_be_requested_again_and_a_limit_is_of_its_threads_alone() {
        let limit = MemoryLimit::new(1 << 20);
        thread::spawn(|| {
            limit.apply();
            for size in 1..5 {
                let mut bytes = std::hint::black_box(vec![0u8; 70_000 * size]);
                bytes.reserve(80_000 * size);
            }
        })
        .join()
        .unwrap();
        assert!(!limit.is_exceeded() && MemoryLimit::of_thread().is_none());
    }

    #[test]
    fn a_request_beyond_the_limit_and_one_after_the_stop_are_never_answered() {
        let sleeps = |work: fn(&'static MemoryLimit)| {
            let limit = MemoryLimit::new(1 << 20);
            thread::spawn(move || work(limit));
            while !limit.is_exceeded() {
                thread::sleep(Duration::from_millis(1));
            }
        };
        sleeps(|limit| (0..2).for_each(|_| limit.add(700_000)));
        sleeps(|limit| limit.add(usize::MAX));
        sleeps(|limit| {
            limit.apply();
            std::hint::black_box(vec![0u8; 2 << 20]);
        });
        sleeps(|limit| {
            limit.apply();
            let _ = request(MIN_CHECKED_BYTES, std::ptr::null_mut);
        });
        sleeps(|limit| {
            limit.stop();
            limit.add(MIN_CHECKED_BYTES - 1);
            assert!(!limit.is_exceeded());
            limit.add(MIN_CHECKED_BYTES);
        });
    }
}
