//! A doorbell (an auto-reset event on a futex): how a thread sleeps until another one has something for it.
//!
//! One atomic word, and the kernel's `futex` on it: sleep if the word still says so, wake who sleeps. No mutex, so a
//! thread that is suspended while it goes to sleep or wakes holds up nobody, and ringing while nobody sleeps is one
//! atomic swap. Wake-ups are not lost, for three reasons:
//!
//! - A bell that was rung stays rung until one waiter has silenced it, and nobody falls asleep on a rung bell: the
//!   kernel looks at the word again, under the lock that the waker takes, too, and returns at once if it has changed.
//! - Sleepers stand behind the word [`ASLEEP`], which only [`Bell::ring`] replaces, and who replaces it wakes them all.
//!   So while the bell is [`RUNG`] or [`SILENT`], whoever waits is awake or being woken, and will look at the word.
//! - What was done before ringing is seen by whoever silences that ring or a later one: each ring is a release, the
//!   silencing an acquire, and rings in between are read-modify-writes, which carry the release on. So a ring that
//!   finds the bell rung already needs to do nothing more.
//!
//! Of several waiters, only the one that silences the bell is told; if there is something left for others, it rings
//! again. A waiter looks for what it waits for before each wait, and is to expect that it is woken for nothing: a bell
//! may still be rung for what was found without waiting.

use std::time::{Duration, Instant};

use super::sync::{AtomicU32, Ordering};

/// Nobody rang, nobody sleeps.
const SILENT: u32 = 0;
/// Somebody rang, and no waiter has heard it yet.
const RUNG: u32 = 1;
/// Nobody rang, and somebody may be asleep.
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

    /// Rings, and wakes who sleeps. Never waits.
    pub(super) fn ring(&self) {
        // Release: who silences this ring sees what was done before it.
        if self.state.swap(RUNG, Ordering::Release) == ASLEEP {
            self.sleepers.wake(&self.state);
        }
    }

    /// Sleeps until the bell is rung, and silences it.
    pub(super) fn wait(&self) {
        self.wait_until(None);
    }

    /// As [`Bell::wait`], but no longer than `patience`; returns whether the bell was rung.
    pub(super) fn wait_timeout(&self, patience: Duration) -> bool {
        // A time that the clock cannot tell never comes.
        self.wait_until(Instant::now().checked_add(patience))
    }

    /// Sleeps until the bell is rung, and silences it, but not past `deadline`; returns whether the bell was rung.
    pub(super) fn wait_until(&self, deadline: Option<Instant>) -> bool {
        loop {
            // Acquire: sees what was done before the ring that is silenced here. A failure reads nothing of anybody's.
            if self.state.compare_exchange(RUNG, SILENT, Ordering::Acquire, Ordering::Relaxed).is_ok() {
                return true;
            }
            // Relaxed: only tells that there is somebody to wake. Where it was rung in between, silence it instead.
            let announced = self.state.compare_exchange(SILENT, ASLEEP, Ordering::Relaxed, Ordering::Relaxed);
            if announced == Err(RUNG) {
                continue;
            }
            let patience = deadline.map(|deadline| deadline.saturating_duration_since(Instant::now()));
            if patience == Some(Duration::ZERO) {
                // The word may go on saying that somebody sleeps: at worst, one call to the kernel wakes nobody.
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

    /// Sleeps if `word` is `expected`: until woken, for `patience` at most, or shorter for no reason.
    fn sleep(&self, word: &AtomicU32, expected: u32, patience: Option<Duration>) {
        use rustix::thread::futex::{Flags, Timespec, wait};
        // A time that the kernel cannot count waits for as long as it can.
        let patience = patience.map(|patience| Timespec {
            tv_sec: patience.as_secs().try_into().unwrap_or(i64::MAX),
            tv_nsec: patience.subsec_nanos().into(),
        });
        // Woken, too late, interrupted by a signal, or the word has changed: in each case the caller looks again.
        let _ = wait(word, Flags::PRIVATE, expected, patience.as_ref());
    }

    fn wake(&self, word: &AtomicU32) {
        use rustix::thread::futex::{Flags, wake};
        // Fails only for a word that is not there.
        let _ = wake(word, Flags::PRIVATE, i32::MAX as u32);
    }
}

/// The same by the C library's `syscall`, the one way that Miri knows: rustix looks for that symbol at run time.
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
        // SAFETY: `futex` with these arguments reads the word and the time, which live until it returns.
        unsafe { libc::syscall(libc::SYS_futex, word.as_ptr(), wait, expected, timeout) };
    }

    fn wake(&self, word: &AtomicU32) {
        let wake = libc::FUTEX_WAKE | libc::FUTEX_PRIVATE_FLAG;
        // SAFETY: with these arguments only the word's address counts.
        unsafe { libc::syscall(libc::SYS_futex, word.as_ptr(), wake, i32::MAX) };
    }
}

/// The kernel's part as loom can run it: the lock that `futex` holds while it compares the word and queues the thread,
/// and the queue. Time passes at once or never.
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
            // A ring that nobody hears would leave this turning forever.
            while heard.load(Ordering::Acquire) < rung.min(ROUNDS) {
                thread::yield_now();
            }
        }
        bell.ring();
        patient.into_iter().chain([hasty]).for_each(|thread| thread.join().unwrap());
    }
}
