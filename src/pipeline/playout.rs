//! The play-out delay against jitter, when pictures are shown: a steady while after they were captured, so that they
//! come as evenly as they were taken.
//!
//! Work takes now longer, now less long; a picture that is ready early waits for the others' sake. The wait follows
//! what pictures need: nearly all are ready in time, and none waits longer than the age that a picture may have.

/// This share of the pictures is ready in time; the others are shown as soon as they are.
const IN_TIME: f64 = 0.97;
/// The delay falls by this much with every picture that was ready in time; how it rises follows from the share. In
/// periods, as all that follows.
const FALL: f64 = 0.0006;
const RISE: f64 = FALL * IN_TIME / (1.0 - IN_TIME);
/// It rises faster where much is missing, but never by more: one picture alone may be late for no reason.
const RISE_SHARE: f64 = 0.25;
const MOST_RISE: f64 = 0.09;
/// No picture is kept until it is older than this; the rest of two periods is left for the sink. Nor the first ones,
/// which tell little of those to come, beyond the second number.
const MOST: f64 = 1.85;
const MOST_AT_FIRST: f64 = 1.0;

/// The delay from capture to output.
pub(super) struct Playout {
    period_ns: f64,
    /// In periods; unknown before the first picture.
    delay: Option<f64>,
}

impl Playout {
    /// For pictures that come every `period_ns`.
    pub(super) fn new(period_ns: u64) -> Self {
        Self { period_ns: period_ns as f64, delay: None }
    }

    /// When the picture that was captured at `captured_ns` and is ready now is to be shown.
    pub(super) fn due_ns(&mut self, captured_ns: u64, now_ns: u64) -> u64 {
        let age = now_ns.saturating_sub(captured_ns) as f64 / self.period_ns;
        let delay = self.delay.get_or_insert(age.min(MOST_AT_FIRST));
        let due_ns = captured_ns + (*delay * self.period_ns) as u64;
        let missing = age - *delay;
        *delay += if missing > 0.0 { (RISE_SHARE * missing).clamp(RISE.min(missing), MOST_RISE) } else { -FALL };
        *delay = delay.clamp(0.0, MOST);
        due_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    const PERIOD_NS: u64 = 33 * MS;

    /// Shows pictures that are ready after these times; returns the intervals, longest first, and the ages at output.
    fn play(ready_ns: impl Iterator<Item = u64>) -> (Vec<u64>, Vec<u64>) {
        let mut playout = Playout::new(PERIOD_NS);
        let (mut shown, mut ages) = (Vec::new(), Vec::new());
        for (frame, ready_ns) in ready_ns.enumerate() {
            let captured_ns = frame as u64 * PERIOD_NS;
            let ready_at_ns = (captured_ns + ready_ns).max(shown.last().copied().unwrap_or(0));
            let shown_ns = playout.due_ns(captured_ns, ready_at_ns).max(ready_at_ns);
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
        assert!(ages[299] <= 15 * MS + 10 * (MOST_RISE * PERIOD_NS as f64) as u64);
    }

    #[test]
    fn nobody_waits_beyond_the_age_that_is_allowed() {
        let (_, ages) = play((0..500).map(|frame| if frame < 250 { 200 * MS } else { 10 * MS }));
        assert!(ages[260..].iter().all(|&age| age as f64 <= MOST * PERIOD_NS as f64 + 1.0));
    }
}
