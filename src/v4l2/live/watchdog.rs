//! What to do about a camera that gives no frames: more with every failure, and never giving up.

use std::time::Duration;

/// Watches over a stream.
#[derive(Debug)]
pub struct Watchdog {
    /// After this time without a frame, the stream has stalled.
    limit_ns: u64,
    /// When the present silence began: at the last start, frame or remedy.
    silent_since_ns: u64,
    /// When the present trouble began, if there is any.
    trouble_ns: Option<u64>,
    /// Remedies tried without a frame since.
    tried: u32,
    /// Errors in a row.
    errors: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Remedy {
    Wait,
    /// Stop the stream and start it.
    Restart,
    /// Close the device, and open it again after this time.
    Reopen(Duration),
}

/// Errors in a row that need a remedy: fewer may pass by themselves.
const MOST_ERRORS: u32 = 8;
/// Frames that may be missing before the stream has stalled, but at least [`LEAST_LIMIT_NS`].
const LIMIT_PERIODS: u64 = 5;
const LEAST_LIMIT_NS: u64 = 1_000_000_000;
const FIRST_PAUSE: Duration = Duration::from_millis(500);
const LONGEST_PAUSE: Duration = Duration::from_secs(2);

impl Watchdog {
    /// Over a stream with this time from frame to frame, which starts at `now_ns`.
    pub fn new(period_ns: u64, now_ns: u64) -> Self {
        let limit_ns = (LIMIT_PERIODS * period_ns).max(LEAST_LIMIT_NS);
        Self { limit_ns, silent_since_ns: now_ns, trouble_ns: None, tried: 0, errors: 0 }
    }

    /// The stream starts (again).
    pub fn started(&mut self, now_ns: u64) {
        self.silent_since_ns = now_ns;
        self.errors = 0;
    }

    /// A frame came. Returns how long there was trouble before it, if there was.
    pub fn frame(&mut self, now_ns: u64) -> Option<Duration> {
        self.silent_since_ns = now_ns;
        (self.tried, self.errors) = (0, 0);
        self.trouble_ns.take().map(|trouble_ns| Duration::from_nanos(now_ns.saturating_sub(trouble_ns)))
    }

    /// No frame came: what to do about it.
    pub fn silence(&mut self, now_ns: u64) -> Remedy {
        if now_ns.saturating_sub(self.silent_since_ns) < self.limit_ns {
            return Remedy::Wait;
        }
        self.remedy(now_ns)
    }

    /// The driver gave an error instead of a frame: what to do about it.
    pub fn error(&mut self, now_ns: u64) -> Remedy {
        self.errors += 1;
        if self.errors < MOST_ERRORS {
            return Remedy::Wait;
        }
        self.remedy(now_ns)
    }

    /// The device went away or cannot be opened: trouble begins, unless there was some before.
    pub fn gone(&mut self, now_ns: u64) {
        self.trouble_ns.get_or_insert(now_ns);
    }

    /// The next stronger remedy; what was tried did not help.
    pub fn remedy(&mut self, now_ns: u64) -> Remedy {
        // It began when the last frame had come.
        self.trouble_ns.get_or_insert(self.silent_since_ns);
        self.silent_since_ns = now_ns;
        self.errors = 0;
        self.tried = self.tried.saturating_add(1);
        match self.tried {
            1 => Remedy::Restart,
            2 => Remedy::Reopen(Duration::ZERO),
            // Pauses double with each try.
            more => Remedy::Reopen((FIRST_PAUSE * 2u32.pow((more - 3).min(4))).min(LONGEST_PAUSE)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 33_333_333;
    const MS: u64 = 1_000_000;

    /// Remedies and their times of a stream that is silent from 0 to `until_ms`, looked at every 100 ms.
    fn silent(period_ns: u64, until_ms: u64) -> Vec<(u64, Remedy)> {
        let mut watchdog = Watchdog::new(period_ns, 0);
        let looks = (100..=until_ms).step_by(100).map(|ms| (ms, watchdog.silence(ms * MS)));
        looks.filter(|look| look.1 != Remedy::Wait).collect()
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
        assert_eq!(after_hours.last().map(|look| look.1), Some(reopen(2000)));
    }

    #[test]
    fn a_slow_camera_is_given_five_periods() {
        assert_eq!(silent(1000 * MS, 4900), []);
        assert_eq!(silent(1000 * MS, 5000), [(5000, Remedy::Restart)]);
    }

    #[test]
    fn a_frame_makes_all_well_and_tells_how_long_it_was_not() {
        let mut watchdog = Watchdog::new(PERIOD_NS, 0);
        assert_eq!(watchdog.frame(50 * MS), None);
        assert_eq!(watchdog.silence(1100 * MS), Remedy::Restart);
        assert_eq!(watchdog.frame(1300 * MS), Some(Duration::from_millis(1250)));
        assert_eq!(watchdog.frame(1333 * MS), None);
        assert_eq!(watchdog.silence(2400 * MS), Remedy::Restart, "from the beginning");
    }

    #[test]
    fn single_errors_pass_and_a_row_of_them_does_not() {
        let mut watchdog = Watchdog::new(PERIOD_NS, 0);
        let mut waits = (1..MOST_ERRORS).map(|error| watchdog.error(u64::from(error) * MS));
        assert!(waits.all(|remedy| remedy == Remedy::Wait), "as many at the start as later");
        watchdog.frame(50 * MS);
        for frame in 0..100 {
            assert_eq!(watchdog.error(frame * MS), Remedy::Wait);
            watchdog.frame(frame * MS);
        }
        let remedies: Vec<Remedy> = (0..2 * MOST_ERRORS).map(|error| watchdog.error(u64::from(error) * MS)).collect();
        let strong: Vec<&Remedy> = remedies.iter().filter(|remedy| **remedy != Remedy::Wait).collect();
        assert_eq!(strong, [&Remedy::Restart, &Remedy::Reopen(Duration::ZERO)]);
    }
}
