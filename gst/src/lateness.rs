//! QoS events of downstream: time budget of a blur, and pictures to drop.

use std::time::{Duration, Instant};

use gst::{ClockTime, QOSType};

/// After this time without output, even a late picture is blurred: ten a second are better than none.
const MAX_GAP: Duration = Duration::from_millis(100);
/// Minimum time budget of a blur, as a fraction of the period.
const MIN_FRACTION: f64 = 0.05;

/// State of the last QoS event.
#[derive(Debug)]
pub struct Lateness {
    /// Frame period.
    pub period: ClockTime,
    /// Pictures due before this running time are late.
    earliest: Option<ClockTime>,
    /// Processing time over available time, until it is used once.
    load: Option<f64>,
    /// Time when a picture was last accepted for blurring.
    last_accepted: Option<Instant>,
}

impl Lateness {
    /// Creates the state before the first event.
    pub fn new(period: ClockTime) -> Self {
        Self { period, earliest: None, load: None, last_accepted: None }
    }

    /// Records an event: `load` is processing time over available time, and the picture due at `timestamp` was
    /// `diff_ns` late.
    pub fn record(&mut self, (kind, load, diff_ns, timestamp): (QOSType, f64, i64, Option<ClockTime>)) {
        // Throttling limits the frame rate; it does not mean overload.
        if kind != QOSType::Throttle {
            self.load = Some(load);
        }
        self.earliest = timestamp.map(|timestamp| match u64::try_from(diff_ns) {
            // Skip ahead by twice the delay, as GStreamer's base classes do: it still grows before it shrinks.
            Ok(late_ns) if late_ns > 0 => timestamp + ClockTime::from_nseconds(2 * late_ns) + self.period,
            _ => timestamp.saturating_sub(ClockTime::from_nseconds(diff_ns.unsigned_abs())),
        });
    }

    /// Returns the time budget of a blur after a new event: its recent time `blur_ns` plus the spare time of a period,
    /// which is negative under overload.
    pub fn budget_ns(&mut self, blur_ns: u64) -> Option<u64> {
        let (load, period_ns) = (self.load.take()?, self.period.nseconds() as f64);
        let spare_ns = (1.0 - load) * period_ns;
        // Without a measured time, the budget is the period.
        let budget_ns = if blur_ns == 0 { period_ns } else { blur_ns as f64 + spare_ns };
        Some(budget_ns.clamp(MIN_FRACTION * period_ns, period_ns) as u64)
    }

    /// Whether a picture due at `due` is too late to blur; if not, it counts as blurred now.
    pub fn is_too_late(&mut self, due: Option<ClockTime>, now: Instant) -> bool {
        let is_late = self.earliest.zip(due).is_some_and(|(earliest, due)| due < earliest);
        let is_starved = self.last_accepted.is_none_or(|last_accepted| now.duration_since(last_accepted) >= MAX_GAP);
        if is_late && !is_starved {
            return true;
        }
        self.last_accepted = Some(now);
        false
    }

    /// Forgets all events, for a seek or a new scene.
    pub fn reset(&mut self) {
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
        lateness.record((QOSType::Underflow, 1.25, 5_000_000, None));
        assert_eq!(lateness.budget_ns(30_000_000), Some(20_000_000));
        assert_eq!(lateness.budget_ns(30_000_000), None, "it is no news any more");
        for (load, budget_ns) in [(0.5, 40_000_000), (3.0, 2_000_000)] {
            lateness.record((QOSType::Overflow, load, -5_000_000, None));
            assert_eq!(lateness.budget_ns(30_000_000), Some(budget_ns), "{load}");
        }
    }

    #[test]
    fn late_pictures_are_left_out_but_never_all() {
        let mut lateness = Lateness::new(PERIOD);
        let (at, now) = (|ms| Some(ClockTime::from_mseconds(ms)), Instant::now());
        assert!(!lateness.is_too_late(at(0), now));
        lateness.record((QOSType::Underflow, 2.0, 30_000_000, at(40)));
        assert!(lateness.is_too_late(at(80), now) && lateness.is_too_late(at(139), now));
        assert!(!lateness.is_too_late(at(140), now), "twice as late as the last one, and the next");
        assert!(!lateness.is_too_late(at(80), now + MAX_GAP));
        lateness.record((QOSType::Overflow, 0.5, -10_000_000, at(200)));
        assert!(!lateness.is_too_late(at(200), now));
    }
}
