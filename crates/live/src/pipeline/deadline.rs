//! Decides which frames are too late to be blurred.

use bokehcam::budget::DEADLINE_PERIODS;

/// Finds frames not worth blurring: a frame that would be delivered later than two periods after its capture, while a
/// newer one is there or about to come. Yet ten late pictures a second are better than none.
pub(super) struct DeadlineRule {
    period_ns: u64,
    /// When a frame last passed.
    last_passed_ns: Option<u64>,
}

/// After this time without a blurred frame, even a late one is blurred.
const MAX_GAP_NS: u64 = 100_000_000;

impl DeadlineRule {
    pub(super) fn new(period_ns: u64) -> Self {
        Self { period_ns, last_passed_ns: None }
    }

    /// Returns whether to skip a frame captured at `captured_ns` whose blur is expected to take `expected_ns`. The
    /// caller is expected to blur a frame that passes.
    pub(super) fn is_late(&mut self, captured_ns: u64, now_ns: u64, expected_ns: u64) -> bool {
        let age_ns = now_ns.saturating_sub(captured_ns);
        // A frame younger than a period is the newest there is.
        let late = age_ns > self.period_ns && age_ns + expected_ns > DEADLINE_PERIODS * self.period_ns;
        let starved = self.last_passed_ns.is_none_or(|last_ns| now_ns.saturating_sub(last_ns) >= MAX_GAP_NS);
        if late && !starved {
            return true;
        }
        self.last_passed_ns = Some(now_ns);
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn old_frames_are_late_but_pictures_never_stop() {
        let mut rule = DeadlineRule::new(33 * MS);
        assert!(!rule.is_late(0, 500 * MS, 0), "the first frame always passes");
        assert!(!rule.is_late(450 * MS, 510 * MS, 0));
        assert!(rule.is_late(440 * MS, 520 * MS, 0));
        assert!(rule.is_late(440 * MS, 609 * MS, 0));
        assert!(!rule.is_late(440 * MS, 610 * MS, 0), "nothing passed for 100 ms");
        assert!(rule.is_late(450 * MS, 611 * MS, 0));
        assert!(!rule.is_late(900 * MS, 800 * MS, 0), "a frame from the future is not old");
    }

    #[test]
    fn a_frame_that_cannot_make_it_is_not_begun_unless_it_is_the_newest() {
        let mut rule = DeadlineRule::new(33 * MS);
        assert!(!rule.is_late(0, 10 * MS, 20 * MS));
        assert!(rule.is_late(0, 40 * MS, 30 * MS), "70 ms after capture is too late");
        assert!(!rule.is_late(0, 40 * MS, 20 * MS));
        assert!(!rule.is_late(40 * MS, 50 * MS, 400 * MS), "however slow the blur, the newest frame is blurred");
    }
}
