//! Time: real, or set by a test.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// A monotonic clock in nanoseconds since it was made. Clones show the same time.
#[derive(Clone, Debug)]
pub struct Clock(Kind);

#[derive(Clone, Debug)]
enum Kind {
    System(Instant),
    Manual(Arc<AtomicU64>),
}

impl Clock {
    /// The system's monotonic clock, starting at 0 now.
    pub fn system() -> Self {
        Self(Kind::System(Instant::now()))
    }

    /// A clock that stands at 0 and moves only by [`Clock::advance_ns`] and by being slept on.
    pub fn manual() -> Self {
        Self(Kind::Manual(Arc::default()))
    }

    /// The time now.
    pub fn now_ns(&self) -> u64 {
        match &self.0 {
            Kind::System(origin) => u64::try_from(origin.elapsed().as_nanos()).unwrap_or(u64::MAX),
            Kind::Manual(now_ns) => now_ns.load(Ordering::SeqCst),
        }
    }

    /// Returns at `until_ns` or, if that has passed, at once. A manual clock jumps there.
    pub fn sleep_until_ns(&self, until_ns: u64) {
        match &self.0 {
            Kind::System(_) => {
                let wait_ns = until_ns.saturating_sub(self.now_ns());
                if wait_ns > 0 {
                    std::thread::sleep(Duration::from_nanos(wait_ns));
                }
            }
            Kind::Manual(now_ns) => {
                now_ns.fetch_max(until_ns, Ordering::SeqCst);
            }
        }
    }

    /// Moves a manual clock on; the system's clock cannot be moved and ignores it.
    pub fn advance_ns(&self, by_ns: u64) {
        if let Kind::Manual(now_ns) = &self.0 {
            now_ns.fetch_add(by_ns, Ordering::SeqCst);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_system_clock_never_wakes_early() {
        let clock = Clock::system();
        let until_ns = clock.now_ns() + 2_000_000;
        clock.sleep_until_ns(until_ns);
        let woke_ns = clock.now_ns();
        assert!(woke_ns >= until_ns);
        clock.advance_ns(1 << 60);
        assert!(clock.now_ns() < 1 << 60);
    }

    #[test]
    fn a_manual_clock_moves_only_when_told() {
        let clock = Clock::manual();
        let seen_elsewhere = clock.clone();
        assert_eq!(clock.now_ns(), 0);
        clock.advance_ns(5);
        clock.sleep_until_ns(40);
        clock.sleep_until_ns(30);
        assert_eq!(seen_elsewhere.now_ns(), 40);
    }
}
