//! Clocks: real, or set by a test.

use std::fs;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use rustix::time::{ClockId, clock_gettime};

/// A monotonic clock in nanoseconds. Clones show the same time.
#[derive(Clone, Debug)]
pub struct Clock(TimeSource);

#[derive(Clone, Debug)]
enum TimeSource {
    System,
    Manual(Arc<AtomicU64>),
}

/// Returns the CPU time that this process has used so far, all of its threads together, in nanoseconds.
pub fn process_cpu_ns() -> u64 {
    let used = clock_gettime(ClockId::ProcessCPUTime);
    used.tv_sec.unsigned_abs() * 1_000_000_000 + used.tv_nsec.unsigned_abs()
}

/// Returns the CPU time of this program so far in nanoseconds: of this process and of its child processes that have
/// ended.
pub fn program_cpu_ns() -> u64 {
    process_cpu_ns() + ended_children_cpu_ns()
}

/// Returns the CPU time of the child processes that have ended, to 10 ms; 0 if the system does not tell it.
fn ended_children_cpu_ns() -> u64 {
    /// A tick in the kernel's files: `USER_HZ` is 100.
    const TICK_NS: u64 = 10_000_000;
    let stat = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // proc(5): the name, in brackets, may contain any characters; cutime and cstime are the 14th and 15th field after it.
    let fields = stat.rsplit_once(')').map_or("", |(_, fields)| fields).split_whitespace();
    fields.skip(13).take(2).filter_map(|ticks| ticks.parse::<u64>().ok()).sum::<u64>() * TICK_NS
}

impl Clock {
    /// Returns the system's monotonic clock (`CLOCK_MONOTONIC`), which drivers also use for a camera's timestamps.
    pub fn system() -> Self {
        Self(TimeSource::System)
    }

    /// Creates a clock that starts at 0 and moves only by [`Clock::advance_ns`] and by sleeping on it.
    pub fn manual() -> Self {
        Self(TimeSource::Manual(Arc::default()))
    }

    /// Returns the current time in nanoseconds.
    pub fn now_ns(&self) -> u64 {
        match &self.0 {
            TimeSource::System => {
                let now = clock_gettime(ClockId::Monotonic);
                // It starts at 0 at boot: neither part is negative.
                now.tv_sec.unsigned_abs() * 1_000_000_000 + now.tv_nsec.unsigned_abs()
            }
            TimeSource::Manual(now_ns) => now_ns.load(Ordering::SeqCst),
        }
    }

    /// Sleeps until `until_ns`; returns at once if that has passed. A manual clock jumps there.
    pub fn sleep_until_ns(&self, until_ns: u64) {
        match &self.0 {
            TimeSource::System => {
                let wait_ns = until_ns.saturating_sub(self.now_ns());
                if wait_ns > 0 {
                    std::thread::sleep(Duration::from_nanos(wait_ns));
                }
            }
            TimeSource::Manual(now_ns) => {
                now_ns.fetch_max(until_ns, Ordering::SeqCst);
            }
        }
    }

    /// Advances a manual clock; has no effect on the system's clock.
    pub fn advance_ns(&self, by_ns: u64) {
        if let TimeSource::Manual(now_ns) = &self.0 {
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
        assert!(clock.now_ns() < until_ns + (1 << 60));
    }

    #[test]
    fn a_child_that_has_ended_counts_as_part_of_the_program() {
        let before_ns = ended_children_cpu_ns();
        let script = "i=0; while [ $i -lt 200000 ]; do i=$((i+1)); done";
        assert!(std::process::Command::new("sh").args(["-c", script]).status().unwrap().success());
        assert!(ended_children_cpu_ns() >= before_ns + 20_000_000);
        assert!(program_cpu_ns() >= ended_children_cpu_ns());
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
