//! Counts the frames that a driver dropped, from its sequence numbers.

/// Compares each frame's sequence number with the previous one.
#[derive(Debug)]
pub struct Sequence {
    /// Sequence number and time stamp of the previous frame.
    last: Option<(u32, Option<u64>)>,
    /// Measured time between consecutive frames.
    period_ns: f64,
}

/// Minimum fraction of the expected time that a gap in the numbers must take to count as lost frames: some drivers
/// number a broken frame twice.
const MIN_GAP_FRACTION: f64 = 0.65;
/// Weight of each new interval in the measured period (exponential moving average).
const PERIOD_SMOOTHING: f64 = 0.1;

impl Sequence {
    /// Creates a counter that expects frames every `period_ns` nanoseconds; the real period is measured.
    pub fn new(period_ns: u64) -> Self {
        Self { last: None, period_ns: period_ns as f64 }
    }

    /// Resets the counter: the stream restarts, and with it the numbers.
    pub fn restart(&mut self) {
        self.last = None;
    }

    /// Adds a frame with this sequence number, captured at `stamp_ns` if the driver reports it. Returns how many frames
    /// were lost since the previous one. With a driver that always repeats one number, no loss can be detected.
    pub fn count_lost(&mut self, number: u32, stamp_ns: Option<u64>) -> u64 {
        let Some((last, last_ns)) = self.last.replace((number, stamp_ns)) else { return 0 };
        let ahead = number.wrapping_sub(last);
        // Backwards: the driver restarted its numbers by itself.
        if ahead == 0 || ahead > u32::MAX / 2 {
            return 0;
        }
        let gap = u64::from(ahead) - 1;
        let passed_ns = stamp_ns.zip(last_ns).and_then(|(now_ns, last_ns)| now_ns.checked_sub(last_ns));
        let Some(passed_ns) = passed_ns.filter(|passed_ns| *passed_ns > 0) else { return gap };
        let passed_ns = passed_ns as f64;
        if gap == 0 {
            // Longer intervals are pauses: a camera that stalled does not have another rate.
            if passed_ns < 4.0 * self.period_ns {
                self.period_ns += PERIOD_SMOOTHING * (passed_ns - self.period_ns);
            }
            return 0;
        }
        if passed_ns >= MIN_GAP_FRACTION * f64::from(ahead) * self.period_ns {
            return gap;
        }
        // The numbers advanced too fast: count the frames that fit into the elapsed time.
        let periods = (passed_ns / self.period_ns).round() as u64;
        periods.saturating_sub(1).min(gap)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 33_333_333;

    /// Counts the losses over frames of (number, time in periods).
    fn losses(frames: &[(u32, f64)]) -> u64 {
        let mut sequence = Sequence::new(PERIOD_NS);
        let stamp = |periods: f64| Some(1_000_000_000 + (periods * PERIOD_NS as f64) as u64);
        frames.iter().map(|(number, periods)| sequence.count_lost(*number, stamp(*periods))).sum()
    }

    #[test]
    fn gaps_count_wherever_the_numbers_begin() {
        assert_eq!(losses(&[(7, 0.0), (8, 1.0), (11, 4.0), (12, 5.0)]), 2);
        assert_eq!(losses(&[(u32::MAX, 0.0), (1, 2.0)]), 1, "numbers wrap");
        let mut untimed = Sequence::new(PERIOD_NS);
        assert_eq!([3, 4, 9].map(|number| untimed.count_lost(number, None)), [0, 0, 4]);
        let mut frozen = Sequence::new(PERIOD_NS);
        assert_eq!(
            [3, 4, 9].map(|number| frozen.count_lost(number, Some(7))),
            [0, 0, 4],
            "a time that stands tells nothing"
        );
    }

    #[test]
    fn a_number_that_jumps_without_time_is_no_loss() {
        assert_eq!(losses(&[(0, 0.0), (1, 1.0), (3, 2.0), (4, 3.0)]), 0);
        assert_eq!(losses(&[(0, 0.0), (1, 1.0), (5, 3.0)]), 1, "four ahead in two periods");
        assert_eq!(losses(&[(0, 0.0), (2, 1.7)]), 1, "jitter is no doubt");
    }

    #[test]
    fn numbers_that_stand_or_start_over_lose_nothing() {
        assert_eq!(losses(&[(0, 0.0), (0, 1.0), (0, 2.0)]), 0);
        assert_eq!(losses(&[(100, 0.0), (0, 1.0), (1, 2.0)]), 0);
        let mut sequence = Sequence::new(PERIOD_NS);
        sequence.count_lost(5, Some(1));
        sequence.restart();
        assert_eq!(sequence.count_lost(90, Some(2)), 0);
    }

    #[test]
    fn the_real_period_counts_where_the_stated_one_is_wrong() {
        // Twice the stated rate: the gap of one takes one stated period.
        let mut sequence = Sequence::new(PERIOD_NS);
        let half_ns = PERIOD_NS / 2;
        for number in 0..60 {
            assert_eq!(sequence.count_lost(number, Some(1 + u64::from(number) * half_ns)), 0);
        }
        assert_eq!(sequence.count_lost(61, Some(1 + 61 * half_ns)), 1);
    }
}
