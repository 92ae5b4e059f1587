//! What downstream says of the time (QoS events): how long a blur may take, and which pictures need no blur any more.

use std::time::{Duration, Instant};

use gst::{ClockTime, QOSType};

/// After this time without a picture, even one that comes too late is blurred: ten a second are better than none.
const STARVED: Duration = Duration::from_millis(100);
/// A blur always has this share of a period.
const LEAST_SHARE: f64 = 0.05;

/// The last news from downstream.
#[derive(Debug)]
pub struct Lateness {
    /// Time from picture to picture.
    pub period: ClockTime,
    /// Pictures due before this running time come too late.
    earliest: Option<ClockTime>,
    /// Time that pictures take of the time there is, as news.
    load: Option<f64>,
    /// When a picture was last found worth its blur.
    passed: Option<Instant>,
}

impl Lateness {
    /// Nobody has said anything yet.
    pub fn new(period: ClockTime) -> Self {
        Self { period, earliest: None, load: None, passed: None }
    }

    /// Takes in an event: pictures take `load` of the time there is, and that which was due at `timestamp` came `diff_ns` late.
    pub fn note(&mut self, (kind, load, diff_ns, timestamp): (QOSType, f64, i64, Option<ClockTime>)) {
        // Who asks for fewer pictures has time enough.
        if kind != QOSType::Throttle {
            self.load = Some(load);
        }
        self.earliest = timestamp.map(|timestamp| match u64::try_from(diff_ns) {
            // It gets worse before it gets better.
            Ok(late_ns) if late_ns > 0 => timestamp + ClockTime::from_nseconds(2 * late_ns) + self.period,
            _ => timestamp.saturating_sub(ClockTime::from_nseconds(diff_ns.unsigned_abs())),
        });
    }

    /// How long a blur may take, if there is news: it took `blur_ns` of late, and gives back what is too much in a period.
    pub fn budget_ns(&mut self, blur_ns: u64) -> Option<u64> {
        let (load, period_ns) = (self.load.take()?, self.period.nseconds() as f64);
        let spare_ns = (1.0 - load) * period_ns;
        // Without knowing what it took, all that is known is that there is a period.
        let budget_ns = if blur_ns == 0 { period_ns } else { blur_ns as f64 + spare_ns };
        Some(budget_ns.clamp(LEAST_SHARE * period_ns, period_ns) as u64)
    }

    /// Whether a picture that is due at `due` comes too late to be blurred; one that does not is taken to be blurred now.
    pub fn is_too_late(&mut self, due: Option<ClockTime>, now: Instant) -> bool {
        let is_late = self.earliest.zip(due).is_some_and(|(earliest, due)| due < earliest);
        let is_starved = self.passed.is_none_or(|passed| now.duration_since(passed) >= STARVED);
        if is_late && !is_starved {
            return true;
        }
        self.passed = Some(now);
        false
    }

    /// Another scene comes.
    pub fn forget(&mut self) {
        *self = Self::new(self.period);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: ClockTime = ClockTime::from_mseconds(40);

    #[test]
    fn who_is_late_gives_back_what_is_too_much() {
        let mut lateness = Lateness::new(PERIOD);
        assert_eq!(lateness.budget_ns(30_000_000), None, "nobody has said anything");
        lateness.note((QOSType::Underflow, 1.25, 5_000_000, None));
        assert_eq!(lateness.budget_ns(30_000_000), Some(20_000_000));
        assert_eq!(lateness.budget_ns(30_000_000), None, "it is no news any more");
        for (load, budget_ns) in [(0.5, 40_000_000), (3.0, 2_000_000)] {
            lateness.note((QOSType::Overflow, load, -5_000_000, None));
            assert_eq!(lateness.budget_ns(30_000_000), Some(budget_ns), "{load}");
        }
    }

    #[test]
    fn late_pictures_are_left_out_but_never_all() {
        let mut lateness = Lateness::new(PERIOD);
        let (at, now) = (|ms| Some(ClockTime::from_mseconds(ms)), Instant::now());
        assert!(!lateness.is_too_late(at(0), now));
        lateness.note((QOSType::Underflow, 2.0, 30_000_000, at(40)));
        assert!(lateness.is_too_late(at(80), now) && lateness.is_too_late(at(139), now));
        assert!(!lateness.is_too_late(at(140), now), "twice as late as the last one, and the next");
        assert!(!lateness.is_too_late(at(80), now + STARVED));
        lateness.note((QOSType::Overflow, 0.5, -10_000_000, at(200)));
        assert!(!lateness.is_too_late(at(200), now));
    }
}
