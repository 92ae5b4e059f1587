//! The play-out delay against jitter: pictures are shown at a steady delay after capture, so that they come out as
//! evenly as they were captured.
//!
//! The processing time varies, so a picture that is ready early waits. The delay adapts to that time: nearly all
//! pictures are ready before it has passed, and none waits until it is too old.

/// Fraction of the pictures that are to be ready in time; the others are shown as soon as they are ready.
const IN_TIME_FRACTION: f64 = 0.97;
/// Decrease of the delay per picture that was in time, in periods like all that follow.
const DELAY_DECREASE: f64 = 0.0006;
/// Increase per late picture: both balance when the fraction [`IN_TIME_FRACTION`] is in time.
const DELAY_INCREASE: f64 = DELAY_DECREASE * IN_TIME_FRACTION / (1.0 - IN_TIME_FRACTION);
/// If a picture was very late, the delay rises by this fraction of its lateness instead,
const LATENESS_FRACTION: f64 = 0.25;
/// but never by more than this, since a single picture may be late by accident.
const MAX_DELAY_INCREASE: f64 = 0.09;
/// Longest delay; the rest of two periods is left for the sink.
const MAX_DELAY: f64 = 1.85;
/// Longest initial delay: the first picture says little about later ones.
const MAX_FIRST_DELAY: f64 = 1.0;

/// The delay from capture to output.
pub(super) struct PlayoutDelay {
    period_ns: f64,
    /// In periods; `None` before the first picture.
    delay: Option<f64>,
}

impl PlayoutDelay {
    /// Creates the delay for pictures that come every `period_ns`.
    pub(super) fn new(period_ns: u64) -> Self {
        Self { period_ns: period_ns as f64, delay: None }
    }

    /// Returns when to show the picture that was captured at `captured_ns` and is ready now, in the past if it is late.
    /// Adapts the delay.
    pub(super) fn due_time_ns(&mut self, captured_ns: u64, now_ns: u64) -> u64 {
        let age = now_ns.saturating_sub(captured_ns) as f64 / self.period_ns;
        let delay = self.delay.get_or_insert(age.min(MAX_FIRST_DELAY));
        let due_ns = captured_ns + (*delay * self.period_ns) as u64;
        let late_by = age - *delay;
        // At least by `DELAY_INCREASE`, but not beyond the need of this picture.
        *delay += if late_by > 0.0 {
            (LATENESS_FRACTION * late_by).clamp(DELAY_INCREASE.min(late_by), MAX_DELAY_INCREASE)
        } else {
            -DELAY_DECREASE
        };
        *delay = delay.clamp(0.0, MAX_DELAY);
        due_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    const PERIOD_NS: u64 = 33 * MS;

    /// Plays pictures that are ready after the given times; returns the intervals, longest first, and the ages at
    /// output.
    fn play(ready_ns: impl Iterator<Item = u64>) -> (Vec<u64>, Vec<u64>) {
        let mut playout = PlayoutDelay::new(PERIOD_NS);
        let (mut shown, mut ages) = (Vec::new(), Vec::new());
        for (frame, ready_ns) in ready_ns.enumerate() {
            let captured_ns = frame as u64 * PERIOD_NS;
            let ready_at_ns = (captured_ns + ready_ns).max(shown.last().copied().unwrap_or(0));
            let shown_ns = playout.due_time_ns(captured_ns, ready_at_ns).max(ready_at_ns);
            shown.push(shown_ns);
            ages.push(shown_ns - captured_ns);
        }
        let mut intervals: Vec<u64> = shown.windows(2).map(|pair| pair[1] - pair[0]).collect();
        intervals.sort_unstable_by(|a, b| b.cmp(a));
        (intervals, ages)
    }

    #[test]
    fn what_is_ready_unevenly_is_shown_evenly() {
        // Every other picture needs 20 ms more.
        let (intervals, ages) = play((0..2000).map(|frame| (20 + 20 * (frame % 2)) * MS));
        assert!(intervals[40] < PERIOD_NS + 2 * MS, "{:?}", &intervals[..60]);
        assert!(ages[100..].iter().all(|&age| age <= 43 * MS));
    }

    #[test]
    fn the_delay_follows_what_is_needed_both_ways() {
        let (_, ages) = play((0..4000).map(|frame| if (500..1000).contains(&frame) { 50 * MS } else { 15 * MS }));
        assert!(ages[499] < 16 * MS && ages[999] >= 50 * MS, "{} {}", ages[499], ages[999]);
        assert!(ages[3999] < 16 * MS, "{}", ages[3999]);
    }

    #[test]
    fn one_late_picture_delays_the_others_by_little() {
        let (_, ages) = play((0..300).map(|frame| if frame == 100 { 300 * MS } else { 15 * MS }));
        assert!(ages[150..].iter().all(|&age| age <= 45 * MS), "{:?}", ages.iter().max());
        assert!(ages[299] <= 15 * MS + 10 * (MAX_DELAY_INCREASE * PERIOD_NS as f64) as u64);
    }

    #[test]
    fn nobody_waits_beyond_the_age_that_is_allowed() {
        let (_, ages) = play((0..500).map(|frame| if frame < 250 { 200 * MS } else { 10 * MS }));
        assert!(ages[260..].iter().all(|&age| age as f64 <= MAX_DELAY * PERIOD_NS as f64 + 1.0));
    }
}
