//! Converts frames at irregular times to a constant frame rate.

use std::time::Duration;

/// Decides which frames of a constant-rate stream to repeat or drop, so that its duration matches that of the frames.
#[derive(Debug)]
pub(super) struct RateConverter {
    /// Pictures per second, as numerator and denominator.
    rate: (u64, u64),
    max_gap: Duration,
    first_ns: Option<u64>,
    /// Time missing from the stream, because long gaps were cut.
    cut_ns: u64,
    /// Number of pictures in the stream, repeated ones included.
    written: u64,
    /// Number of dropped frames.
    pub dropped: u64,
}

/// What to do with a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Action {
    /// Repeat the last picture this many times, then write the frame.
    Repeat(u64),
    /// The same, after a gap of this length, which was too long to be filled.
    RepeatAfterGap(u64, Duration),
    /// Drop it: it comes too soon after the previous one.
    Skip,
}

/// A frame may be early or late by this fraction of a period before one is dropped or repeated: more than jitter.
const MAX_OFFSET_PERIODS: f64 = 0.75;

impl RateConverter {
    /// Creates a stream of `rate`, in which no picture is repeated for longer than `max_gap`.
    pub(super) fn new(rate: (u64, u64), max_gap: Duration) -> Self {
        Self { rate, max_gap, first_ns: None, cut_ns: 0, written: 0, dropped: 0 }
    }

    /// Longest time for which one picture is repeated.
    pub(super) fn max_gap(&self) -> Duration {
        self.max_gap
    }

    /// Decides what to do with the next frame, captured at `time_ns`.
    pub(super) fn schedule(&mut self, time_ns: u64) -> Action {
        let first_ns = *self.first_ns.get_or_insert(time_ns);
        let pictures_per_ns = self.rate.0 as f64 / (self.rate.1 as f64 * 1e9);
        let elapsed_ns = time_ns.saturating_sub(first_ns).saturating_sub(self.cut_ns);
        // In periods: 0 is on time for the next picture of the stream, more is late.
        let late_periods = elapsed_ns as f64 * pictures_per_ns - self.written as f64;
        if late_periods < -MAX_OFFSET_PERIODS {
            self.dropped += 1;
            return Action::Skip;
        }
        let missing = (late_periods + 1.0 - MAX_OFFSET_PERIODS).floor().max(0.0) as u64;
        let max_repeats = (self.max_gap.as_nanos() as f64 * pictures_per_ns).ceil() as u64;
        self.written += missing.min(max_repeats) + 1;
        if missing <= max_repeats {
            return Action::Repeat(missing);
        }
        self.cut_ns += ((missing - max_repeats) as f64 / pictures_per_ns) as u64;
        Action::RepeatAfterGap(max_repeats, Duration::from_nanos((missing as f64 / pictures_per_ns) as u64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND_NS: u64 = 1_000_000_000;

    /// Returns the number of pictures written for frames at these times; checks that each is within a period of its
    /// time.
    fn written(rate: (u64, u64), times_ns: impl Iterator<Item = u64>) -> u64 {
        let mut converter = RateConverter::new(rate, Duration::from_secs(10));
        let (mut written, mut first_ns) = (0u64, None);
        for time_ns in times_ns {
            let first_ns = *first_ns.get_or_insert(time_ns);
            match converter.schedule(time_ns) {
                Action::Repeat(missing) => {
                    written += missing + 1;
                    let shown_ns = (written - 1) * SECOND_NS * rate.1 / rate.0;
                    let off_ns = shown_ns.abs_diff(time_ns - first_ns);
                    assert!(off_ns < SECOND_NS * rate.1 / rate.0, "{time_ns}: off by {off_ns}");
                }
                Action::RepeatAfterGap(..) => panic!("{time_ns}"),
                Action::Skip => {}
            }
        }
        written
    }

    #[test]
    fn frames_that_come_evenly_are_written_once_each() {
        for (rate, period_ns) in [((30, 1), 33_333_333), ((30_000, 1001), 33_366_667), ((25, 2), 80_000_000)] {
            assert_eq!(written(rate, (0..3000).map(|k| 77 + k * period_ns)), 3000);
            // The same for frames that come slightly early or late.
            let uneven = |k: u64| 1_000_000_000 + k * period_ns + (k * 7 % 5) * period_ns / 10;
            assert_eq!(written(rate, (0..3000).map(uneven)), 3000);
        }
    }

    #[test]
    fn the_stream_takes_as_long_as_the_frames_did() {
        // Every other frame, two of three, half the rate in the dark, twice the rate, and occasional pauses.
        let every = |kept: fn(&u64) -> bool| (0..300u64).filter(kept).map(|k| k * 40_000_000).collect::<Vec<_>>();
        for times_ns in [
            every(|k| k % 2 == 0),
            every(|k| k % 3 != 1),
            every(|k| *k < 100 || k % 2 == 0),
            every(|k| k % 100 < 30),
            (0..600u64).map(|k| k * 20_000_000).collect(),
        ] {
            let last_ns = *times_ns.last().unwrap();
            let pictures = written((25, 1), times_ns.into_iter());
            assert!((pictures * 40_000_000).abs_diff(last_ns + 40_000_000) <= 40_000_000, "{pictures} for {last_ns}");
        }
    }

    #[test]
    fn a_long_gap_is_cut_and_what_follows_goes_on() {
        let mut converter = RateConverter::new((10, 1), Duration::from_secs(2));
        assert_eq!(converter.schedule(5 * SECOND_NS), Action::Repeat(0));
        assert_eq!(converter.schedule(7 * SECOND_NS), Action::Repeat(19));
        let hour = Duration::from_secs(3600);
        let Action::RepeatAfterGap(20, gap) = converter.schedule(3607 * SECOND_NS + SECOND_NS / 10) else {
            panic!("{converter:?}")
        };
        assert!(gap.abs_diff(hour) < Duration::from_millis(1), "{gap:?}");
        assert_eq!(converter.schedule(3607 * SECOND_NS + SECOND_NS / 5), Action::Repeat(0));
        assert_eq!(converter.schedule(3607 * SECOND_NS + SECOND_NS / 5 + 1), Action::Skip);
        assert_eq!(converter.dropped, 1);
    }
}
