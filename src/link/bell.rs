//! An event count (an auto-reset event on a futex): lets a thread sleep until another one signals it.
//!
//! One atomic word, and the kernel's `futex` on it: sleep if the word still has the expected value, wake the sleepers.
//! There is no mutex, so a thread that is suspended while it goes to sleep or wakes others blocks no other thread, and
//! signalling without sleepers is one atomic swap. Wake-ups are not lost, for three reasons:
//!
//! - A signalled bell stays signalled until one waiter resets it, and no thread falls asleep on a signalled bell: the
//!   kernel compares the word again, under the lock that the waker also takes, and returns at once if it has changed.
//! - Sleepers are covered by the value [`ASLEEP`], which only [`Bell::ring`] replaces, and the thread that replaces it
//!   wakes them all. So while the bell is [`RUNG`] or [`SILENT`], every waiter is awake or being woken, and will check
//!   the word.
//! - Writes before a ring are visible to the waiter that resets this ring or a later one: each ring is a release, the
//!   reset an acquire, and rings in between are read-modify-writes, which continue the release sequence. So a ring that
//!   finds the bell rung already needs no further action.
//!
//! Only the waiter that resets the bell returns; if there is work left for others, it rings again. A waiter checks its
//! condition before each wait, and must expect spurious wake-ups: a bell may still be rung for an item that was found
//! without waiting.

use std::time::{Duration, Instant};

use super::sync::{AtomicU32, Ordering};

/// Not rung, and no thread sleeps.
const SILENT: u32 = 0;
/// Rung, and not yet reset by a waiter.
const RUNG: u32 = 1;
/// Not rung, and a thread may be asleep.
const ASLEEP: u32 = 2;

#[derive(Debug)]
pub(super) struct Bell {
    state: AtomicU32,
    sleepers: Sleepers,
}

impl Bell {
    pub(super) fn new() -> Self {
        Self { state: AtomicU32::new(SILENT), sleepers: Sleepers::new() }
    }

    /// Signals the bell and wakes the sleepers. Never waits.
    pub(super) fn ring(&self) {
        // Release: the waiter that resets this ring sees all writes before it.
        if self.state.swap(RUNG, Ordering::Release) == ASLEEP {
            self.sleepers.wake(&self.state);
        }
    }

    /// Sleeps until the bell is rung, and resets it.
    pub(super) fn wait(&self) {
        self.wait_until(None);
    }

    /// Same as [`Bell::wait`] with a timeout; returns whether the bell was rung.
    pub(super) fn wait_timeout(&self, patience: Duration) -> bool {
        // A deadline beyond the range of the clock never comes.
        self.wait_until(Instant::now().checked_add(patience))
    }

    /// Sleeps until the bell is rung, and resets it, but not past `deadline`; returns whether the bell was rung.
    pub(super) fn wait_until(&self, deadline: Option<Instant>) -> bool {
        loop {
            // Acquire: sees the writes before the ring that is reset here. A failure reads no shared data.
            if self.state.compare_exchange(RUNG, SILENT, Ordering::Acquire, Ordering::Relaxed).is_ok() {
                return true;
            }
            // Relaxed: only announces a sleeper. If the bell was rung in between, reset it instead.
            let announced = self.state.compare_exchange(SILENT, ASLEEP, Ordering::Relaxed, Ordering::Relaxed);
            if announced == Err(RUNG) {
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
    fn a_rung_bell_stays_rung_until_it_is_heard_once() {
        let bell = Bell::new();
        assert!(!bell.wait_timeout(Duration::ZERO));
        bell.ring();
        bell.ring();
        bell.wait();
        assert!(!bell.wait_timeout(Duration::ZERO), "two rings that nobody heard are one");
        bell.ring();
        assert!(bell.wait_timeout(Duration::ZERO), "a ring is heard without patience");
    }

    #[test]
    fn waiting_ends_in_time_and_not_before() {
        let (bell, began) = (Bell::new(), Instant::now());
        assert!(!bell.wait_timeout(PATIENCE));
        assert!(began.elapsed() >= PATIENCE);
        bell.ring();
        assert!(bell.wait_timeout(Duration::MAX), "a bell is heard after somebody gave up on it, and for any patience");
    }

    #[test]
    fn a_waiter_without_a_deadline_wakes_although_others_give_up() {
        const ROUNDS: usize = if cfg!(miri) { 10 } else { 2_000 };
        let bell = Arc::new(Bell::new());
        let heard = Arc::new(AtomicUsize::new(0));
        let patient = [(); 2].map(|()| {
            let (bell, heard) = (bell.clone(), heard.clone());
            thread::spawn(move || {
                while heard.load(Ordering::Acquire) < ROUNDS {
                    bell.wait();
                    heard.fetch_add(1, Ordering::AcqRel);
                }
                // The other one may be asleep.
                bell.ring();
            })
        });
        let hasty = {
            let (bell, heard) = (bell.clone(), heard.clone());
            thread::spawn(move || {
                while heard.load(Ordering::Acquire) < ROUNDS {
                    if bell.wait_timeout(Duration::from_micros(20)) {
                        heard.fetch_add(1, Ordering::AcqRel);
                    }
                }
                bell.ring();
            })
        };
        let mut rung = 0;
        while heard.load(Ordering::Acquire) < ROUNDS {
            bell.ring();
            rung += 1;
            // A lost ring would make this loop endless.
            while heard.load(Ordering::Acquire) < rung.min(ROUNDS) {
                thread::yield_now();
            }
        }
        bell.ring();
        patient.into_iter().chain([hasty]).for_each(|thread| thread.join().unwrap());
    }
}
