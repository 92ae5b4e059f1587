//! An auto-reset event on a futex: lets a thread sleep until another one signals it.
//!
//! One atomic word, and the kernel's `futex` on it: sleep if the word still has the expected value, wake the sleepers.
//! There is no mutex, so a thread that is suspended while it goes to sleep or wakes others blocks no other thread, and
//! signalling without sleepers is one atomic swap. Wake-ups are not lost, for three reasons:
//!
//! - A set event stays set until one waiter resets it, and no thread falls asleep on a set event: the
//!   kernel compares the word again, under the lock that the waker also takes, and returns at once if it has changed.
//! - Sleepers are covered by the value [`ASLEEP`], which only [`AutoResetEvent::set`] replaces, and the thread that replaces it
//!   wakes them all. So while the event is [`SET`] or [`UNSET`], every waiter is awake or being woken, and will check
//!   the word.
//! - Writes before a `set` are visible to the waiter that resets it or a later one: each `set` is a release, the reset an
//!   acquire, and those in between are read-modify-writes, which continue the release sequence. So a `set` that finds
//!   the event set already needs no further action.
//!
//! Only the waiter that resets the event returns; if there is work left for others, it sets the event again. A waiter checks its
//! condition before each wait, and must expect spurious wake-ups: an event may still be set for an item that was found
//! without waiting.

use std::time::{Duration, Instant};

use super::sync::{AtomicU32, Ordering};

/// Not set, and no thread sleeps.
const UNSET: u32 = 0;
/// Set, and not yet reset by a waiter.
const SET: u32 = 1;
/// Not set, and a thread may be asleep.
const ASLEEP: u32 = 2;

#[derive(Debug)]
pub(super) struct AutoResetEvent {
    state: AtomicU32,
    sleepers: Sleepers,
}

impl AutoResetEvent {
    pub(super) fn new() -> Self {
        Self { state: AtomicU32::new(UNSET), sleepers: Sleepers::new() }
    }

    /// Sets the event and wakes the sleepers. Never waits.
    pub(super) fn set(&self) {
        // Release: the waiter that resets it sees all writes before it.
        if self.state.swap(SET, Ordering::Release) == ASLEEP {
            self.sleepers.wake(&self.state);
        }
    }

    /// Sleeps until the event is set, and resets it.
    pub(super) fn wait(&self) {
        self.wait_until(None);
    }

    /// Same as [`AutoResetEvent::wait`] with a timeout; returns whether the event was set.
    pub(super) fn wait_timeout(&self, patience: Duration) -> bool {
        // A deadline beyond the range of the clock never comes.
        self.wait_until(Instant::now().checked_add(patience))
    }

    /// Sleeps until the event is set, and resets it, but not past `deadline`; returns whether the event was set.
    pub(super) fn wait_until(&self, deadline: Option<Instant>) -> bool {
        loop {
            // Acquire: sees the writes before the `set` that is undone here. A failure reads no shared data.
            if self.state.compare_exchange(SET, UNSET, Ordering::Acquire, Ordering::Relaxed).is_ok() {
                return true;
            }
            // Relaxed: only announces a sleeper. If the event was set in between, reset it instead.
            let announced = self.state.compare_exchange(UNSET, ASLEEP, Ordering::Relaxed, Ordering::Relaxed);
            if announced == Err(SET) {
                continue;
            }
            let patience = deadline.map(|deadline| deadline.saturating_duration_since(Instant::now()));
            if patience == Some(Duration::ZERO) {
                // The word may keep announcing a sleeper: at worst, one system call wakes no thread.
                return false;
            }
            self.sleepers.sleep(&self.state, ASLEEP, patience);
        }
    }
}

/// The kernel's list of the threads that sleep on a word.
#[cfg(not(any(loom, miri)))]
#[derive(Debug)]
struct Sleepers;

#[cfg(not(any(loom, miri)))]
impl Sleepers {
    fn new() -> Self {
        Self
    }

    /// Sleeps if `word` is `expected`: until woken, for at most `patience`, or shorter (spurious wake-up).
    fn sleep(&self, word: &AtomicU32, expected: u32, patience: Option<Duration>) {
        use rustix::thread::futex::{Flags, Timespec, wait};
        // A timeout beyond the range of the kernel waits for as long as it can.
        let patience = patience.map(|patience| Timespec {
            tv_sec: patience.as_secs().try_into().unwrap_or(i64::MAX),
            tv_nsec: patience.subsec_nanos().into(),
        });
        // Woken, timed out, interrupted by a signal, or the word has changed: in each case the caller checks again.
        let _ = wait(word, Flags::PRIVATE, expected, patience.as_ref());
    }

    fn wake(&self, word: &AtomicU32) {
        use rustix::thread::futex::{Flags, wake};
        // Fails only for an invalid address.
        let _ = wake(word, Flags::PRIVATE, i32::MAX as u32);
    }
}

/// Same through the C library's `syscall`, the only way that Miri supports: rustix looks up that symbol at run time.
#[cfg(miri)]
#[derive(Debug)]
struct Sleepers;

#[cfg(miri)]
#[allow(unsafe_code)]
impl Sleepers {
    fn new() -> Self {
        Self
    }

    fn sleep(&self, word: &AtomicU32, expected: u32, patience: Option<Duration>) {
        let patience = patience.map(|patience| libc::timespec {
            tv_sec: patience.as_secs().try_into().unwrap_or(i64::MAX),
            tv_nsec: patience.subsec_nanos().into(),
        });
        let timeout = patience.as_ref().map_or(std::ptr::null(), std::ptr::from_ref);
        let wait = libc::FUTEX_WAIT | libc::FUTEX_PRIVATE_FLAG;
        // SAFETY: `futex` with these arguments reads the word and the timeout, which live until it returns.
        unsafe { libc::syscall(libc::SYS_futex, word.as_ptr(), wait, expected, timeout) };
    }

    fn wake(&self, word: &AtomicU32) {
        let wake = libc::FUTEX_WAKE | libc::FUTEX_PRIVATE_FLAG;
        // SAFETY: with these arguments only the word's address is used.
        unsafe { libc::syscall(libc::SYS_futex, word.as_ptr(), wake, i32::MAX) };
    }
}

/// The kernel's part as loom can run it: the lock that `futex` holds while it compares the word and queues the thread,
/// and the queue. Timeouts expire at once or never.
#[cfg(loom)]
#[derive(Debug)]
struct Sleepers {
    lock: loom::sync::Mutex<()>,
    queue: loom::sync::Condvar,
}

#[cfg(loom)]
impl Sleepers {
    fn new() -> Self {
        Self { lock: loom::sync::Mutex::new(()), queue: loom::sync::Condvar::new() }
    }

    fn sleep(&self, word: &AtomicU32, expected: u32, _: Option<Duration>) {
        let lock = self.lock.lock().unwrap();
        if word.load(Ordering::Relaxed) == expected {
            drop(self.queue.wait(lock));
        }
    }

    fn wake(&self, _: &AtomicU32) {
        drop(self.lock.lock().unwrap());
        self.queue.notify_all();
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::AtomicUsize;
    use std::thread;

    use super::*;

    const PATIENCE: Duration = Duration::from_millis(20);

    #[test]
    fn an_event_stays_set_until_one_waiter_resets_it() {
        let event = AutoResetEvent::new();
        assert!(!event.wait_timeout(Duration::ZERO));
        event.set();
        event.set();
        event.wait();
        assert!(!event.wait_timeout(Duration::ZERO), "two sets without a waiter are one");
        event.set();
        assert!(event.wait_timeout(Duration::ZERO), "a set event ends a wait without patience");
    }

    #[test]
    fn waiting_ends_in_time_and_not_before() {
        let (event, began) = (AutoResetEvent::new(), Instant::now());
        assert!(!event.wait_timeout(PATIENCE));
        assert!(began.elapsed() >= PATIENCE);
        event.set();
        assert!(
            event.wait_timeout(Duration::MAX),
            "an event ends a wait after an earlier one timed out, and for any patience"
        );
    }

    #[test]
    fn a_waiter_without_a_deadline_wakes_although_others_give_up() {
        const ROUNDS: usize = if cfg!(miri) { 10 } else { 2_000 };
        let event = Arc::new(AutoResetEvent::new());
        let received = Arc::new(AtomicUsize::new(0));
        let patient = [(); 2].map(|()| {
            let (event, received) = (event.clone(), received.clone());
            thread::spawn(move || {
                while received.load(Ordering::Acquire) < ROUNDS {
                    event.wait();
                    received.fetch_add(1, Ordering::AcqRel);
                }
                // The other one may be asleep.
                event.set();
            })
        });
        let hasty = {
            let (event, received) = (event.clone(), received.clone());
            thread::spawn(move || {
                while received.load(Ordering::Acquire) < ROUNDS {
                    if event.wait_timeout(Duration::from_micros(20)) {
                        received.fetch_add(1, Ordering::AcqRel);
                    }
                }
                event.set();
            })
        };
        let mut sent = 0;
        while received.load(Ordering::Acquire) < ROUNDS {
            event.set();
            sent += 1;
            // A lost wake-up would make this loop endless.
            while received.load(Ordering::Acquire) < sent.min(ROUNDS) {
                thread::yield_now();
            }
        }
        event.set();
        patient.into_iter().chain([hasty]).for_each(|thread| thread.join().unwrap());
    }
}
