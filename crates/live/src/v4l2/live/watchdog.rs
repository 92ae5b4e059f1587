//! Escalating remedies for a camera that delivers no frames; never gives up.

use std::time::Duration;

/// Watches over a stream.
#[derive(Debug)]
pub struct Watchdog {
    /// Time without a frame after which the stream counts as stalled.
    timeout_ns: u64,
    /// Start of the current silence: the last start, frame or remedy.
    silent_since_ns: u64,
    /// When the current failure began, if there is one.
    failing_since_ns: Option<u64>,
    /// Remedies tried since the last frame.
    attempts: u32,
    /// Consecutive errors.
    errors: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Remedy {
    Wait,
    /// Stop the stream and start it again.
    Restart,
    /// Close the device, and reopen it after this time.
    Reopen(Duration),
}

/// Consecutive errors that need a remedy: fewer may pass by themselves.
const MAX_ERRORS: u32 = 8;
/// Missing frames after which the stream counts as stalled, but at least [`MIN_TIMEOUT_NS`].
const TIMEOUT_PERIODS: u64 = 5;
const MIN_TIMEOUT_NS: u64 = 1_000_000_000;
const MIN_PAUSE: Duration = Duration::from_millis(500);
const MAX_PAUSE: Duration = Duration::from_secs(2);

impl Watchdog {
    /// Creates a watchdog for a stream with this time between frames, which starts at `now_ns`.
    pub fn new(period_ns: u64, now_ns: u64) -> Self {
        let timeout_ns = (TIMEOUT_PERIODS * period_ns).max(MIN_TIMEOUT_NS);
        Self { timeout_ns, silent_since_ns: now_ns, failing_since_ns: None, attempts: 0, errors: 0 }
    }

    /// Restarts the time limit: the stream starts (again).
    pub fn on_start(&mut self, now_ns: u64) {
        self.silent_since_ns = now_ns;
        self.errors = 0;
    }

    /// Handles a frame. Returns how long the failure before it lasted, if there was one.
    pub fn on_frame(&mut self, now_ns: u64) -> Option<Duration> {
        self.silent_since_ns = now_ns;
        (self.attempts, self.errors) = (0, 0);
        self.failing_since_ns
            .take()
            .map(|failing_since_ns| Duration::from_nanos(now_ns.saturating_sub(failing_since_ns)))
    }

    /// Returns the remedy after a wait without a frame.
    pub fn on_silence(&mut self, now_ns: u64) -> Remedy {
        if now_ns.saturating_sub(self.silent_since_ns) < self.timeout_ns {
            return Remedy::Wait;
        }
        self.escalate(now_ns)
    }

    /// Returns the remedy after a driver error.
    pub fn on_error(&mut self, now_ns: u64) -> Remedy {
        self.errors += 1;
        if self.errors < MAX_ERRORS {
            return Remedy::Wait;
        }
        self.escalate(now_ns)
    }

    /// Marks the device as gone or impossible to open: a failure begins, unless one is in progress.
    pub fn on_gone(&mut self, now_ns: u64) {
        self.failing_since_ns.get_or_insert(now_ns);
    }

    /// Returns the next stronger remedy, since the last one did not help.
    pub fn escalate(&mut self, now_ns: u64) -> Remedy {
        // The failure began when the last frame had come.
        self.failing_since_ns.get_or_insert(self.silent_since_ns);
        self.silent_since_ns = now_ns;
        self.errors = 0;
        self.attempts = self.attempts.saturating_add(1);
        match self.attempts {
            1 => Remedy::Restart,
            2 => Remedy::Reopen(Duration::ZERO),
            // Pauses double with each try.
            more => Remedy::Reopen((MIN_PAUSE * 2u32.pow((more - 3).min(4))).min(MAX_PAUSE)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 33_333_333;
    const MS: u64 = 1_000_000;

    /// Lists remedies and their times for a stream that is silent from 0 to `until_ms`, checked every 100 ms.
    fn silent(period_ns: u64, until_ms: u64) -> Vec<(u64, Remedy)> {
        let mut watchdog = Watchdog::new(period_ns, 0);
        let checks = (100..=until_ms).step_by(100).map(|ms| (ms, watchdog.on_silence(ms * MS)));
        checks.filter(|check| check.1 != Remedy::Wait).collect()
    }

    #[test]
    fn each_remedy_is_stronger_than_the_last_and_it_never_ends() {
        let reopen = |ms| Remedy::Reopen(Duration::from_millis(ms));
        let expected = [
            (1000, Remedy::Restart),
            (2000, reopen(0)),
            (3000, reopen(500)),
            (4000, reopen(1000)),
            (5000, reopen(2000)),
            (6000, reopen(2000)),
        ];
        assert_eq!(silent(PERIOD_NS, 6000), expected);
        let after_hours = silent(PERIOD_NS, 10_000_000);
        assert_eq!(after_hours.len(), 10_000);
        assert_eq!(after_hours.last().map(|check| check.1), Some(reopen(2000)));
    }

    #[test]
    fn a_slow_camera_is_given_five_periods() {
        assert_eq!(silent(1000 * MS, 4900), []);
        assert_eq!(silent(1000 * MS, 5000), [(5000, Remedy::Restart)]);
    }

    #[test]
    fn a_frame_makes_all_well_and_tells_how_long_it_was_not() {
        let mut watchdog = Watchdog::new(PERIOD_NS, 0);
        assert_eq!(watchdog.on_frame(50 * MS), None);
        assert_eq!(watchdog.on_silence(1100 * MS), Remedy::Restart);
        assert_eq!(watchdog.on_frame(1300 * MS), Some(Duration::from_millis(1250)));
        assert_eq!(watchdog.on_frame(1333 * MS), None);
        assert_eq!(watchdog.on_silence(2400 * MS), Remedy::Restart, "from the beginning");
    }

    #[test]
    fn single_errors_pass_and_a_row_of_them_does_not() {
        let mut watchdog = Watchdog::new(PERIOD_NS, 0);
        let mut waits = (1..MAX_ERRORS).map(|error| watchdog.on_error(u64::from(error) * MS));
        assert!(waits.all(|remedy| remedy == Remedy::Wait), "as many at the start as later");
        watchdog.on_frame(50 * MS);
        for frame in 0..100 {
            assert_eq!(watchdog.on_error(frame * MS), Remedy::Wait);
            watchdog.on_frame(frame * MS);
        }
        let remedies: Vec<Remedy> = (0..2 * MAX_ERRORS).map(|error| watchdog.on_error(u64::from(error) * MS)).collect();
        let strong: Vec<&Remedy> = remedies.iter().filter(|remedy| **remedy != Remedy::Wait).collect();
        assert_eq!(strong, [&Remedy::Restart, &Remedy::Reopen(Duration::ZERO)]);
    }
}
