//! Which frames are blurred, and how finely: what there is time for.

use crate::bokeh::rung::COSTS;
use crate::budget::{DEADLINE_PERIODS, DepthTimes, Plan, Planner, Quality, Sample};
use crate::look::QualityRule;

/// Picks the quality of each frame, and how depth is made, by the time there is.
pub(super) struct Picker {
    /// The rungs to pick from, cheapest first.
    rungs: &'static [Quality],
    planner: Planner,
}

impl Picker {
    /// The blur of a frame may take `budget_ns`; where frames come every `period_ns` in real time, there is a deadline, too,
    /// and depth is made as there is time, with efforts of these costs, and shared by frames only where it may be. No frame is blurred more finely than `finest` unless
    /// that was asked for.
    pub(super) fn new(
        (rule, finest): (QualityRule, Quality),
        budget_ns: u64,
        period_ns: Option<u64>,
        depth: (&[f64], bool),
    ) -> Self {
        let (rungs, costs, places) = Self::ladder(rule, finest);
        Self { rungs, planner: Planner::new((budget_ns, period_ns), depth, costs, places) }
    }

    /// The same under another rule, for another executor. What was learnt of the time that rungs take holds no more.
    pub(super) fn with(&self, rule: QualityRule, finest: Quality) -> Self {
        let (rungs, costs, places) = Self::ladder(rule, finest);
        Self { rungs, planner: self.planner.with_blur(costs, places) }
    }

    /// The qualities that `rule` allows, cheapest first, what they cost, and which of them is the usual and which the first.
    fn ladder(rule: QualityRule, finest: Quality) -> (&'static [Quality], &'static [f64], [usize; 2]) {
        let at = |quality: Quality| quality as usize;
        match rule {
            QualityRule::Fixed(quality) => (&Quality::ALL[at(quality)..=at(quality)], &[1.0], [0, 0]),
            QualityRule::Auto(start) => {
                let places = [Quality::default(), start].map(|quality| at(quality.min(finest)));
                (&Quality::ALL[..=at(finest)], &COSTS[..=at(finest)], places)
            }
        }
    }

    /// A blur may take so long from now on.
    pub(super) fn allow(&mut self, budget_ns: u64) {
        self.planner.allow(budget_ns);
    }

    /// What the next frame gets.
    pub(super) fn plan(&self) -> Plan {
        self.planner.plan()
    }

    /// The quality of the next frame.
    pub(super) fn quality(&self) -> Quality {
        self.rungs[self.plan().rung]
    }

    /// How long the blur of the next frame is likely to take; 0 before anything is known.
    pub(super) fn expected_ns(&self) -> u64 {
        self.planner.expected_blur_ns().unwrap_or(0)
    }

    /// The depth of a frame took so long.
    pub(super) fn note_depth(&mut self, times: DepthTimes) {
        self.planner.note_depth(times);
    }

    /// A frame came too late.
    pub(super) fn note_late(&mut self) {
        self.planner.note_late();
    }

    /// A frame of this quality took so long to blur, and was done at `at_ns`.
    pub(super) fn note(&mut self, quality: Quality, took_ns: u64, at_ns: u64) {
        if let Some(rung) = self.rungs.iter().position(|&rung| rung == quality) {
            self.planner.note_blur(Sample { rung, took_ns, at_ns });
        }
    }
}

/// When a frame is not worth blurring: it would be delivered later than two periods after its capture, and there is a
/// newer one already or soon. But rather ten pictures a second, old as they are, than none.
pub(super) struct LateRule {
    period_ns: u64,
    /// When a frame was last found not to be late.
    last_passed_ns: Option<u64>,
}

/// After this time without a blurred frame, even a late one is blurred.
const STARVED_NS: u64 = 100_000_000;

impl LateRule {
    pub(super) fn new(period_ns: u64) -> Self {
        Self { period_ns, last_passed_ns: None }
    }

    /// Whether not to blur a frame that was captured at `captured_ns` and whose blur is expected to take `expected_ns`.
    /// A frame that is not late is taken to be blurred.
    pub(super) fn is_late(&mut self, captured_ns: u64, now_ns: u64, expected_ns: u64) -> bool {
        let age_ns = now_ns.saturating_sub(captured_ns);
        // Younger than a period, it is the newest there is.
        let late = age_ns > self.period_ns && age_ns + expected_ns > DEADLINE_PERIODS * self.period_ns;
        let starved = self.last_passed_ns.is_none_or(|last_ns| now_ns.saturating_sub(last_ns) >= STARVED_NS);
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
        let mut rule = LateRule::new(33 * MS);
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
        let mut rule = LateRule::new(33 * MS);
        assert!(!rule.is_late(0, 10 * MS, 20 * MS));
        assert!(rule.is_late(0, 40 * MS, 30 * MS), "70 ms after capture is too late");
        assert!(!rule.is_late(0, 40 * MS, 20 * MS));
        assert!(!rule.is_late(40 * MS, 50 * MS, 400 * MS), "however slow the blur, the newest frame is blurred");
    }

    /// Blurs frames that take 4 ms at the usual quality; returns the last quality.
    fn blurred(rule: QualityRule, finest: Quality) -> Quality {
        let mut picker = Picker::new((rule, finest), 30 * MS, Some(30 * MS), (&[1.0], true));
        for frame in 0..200 {
            let quality = picker.quality();
            picker.note(quality, (COSTS[quality as usize] * 4.0 * MS as f64) as u64, frame * 30 * MS);
        }
        picker.quality()
    }

    #[test]
    fn auto_goes_as_far_as_it_may_and_a_fixed_quality_stays() {
        assert_eq!(blurred(QualityRule::Auto(Quality::Fast), Quality::Best), Quality::Best);
        assert_eq!(blurred(QualityRule::Auto(Quality::Best), Quality::Balanced), Quality::Balanced);
        assert_eq!(blurred(QualityRule::Fixed(Quality::Fast), Quality::Best), Quality::Fast);
    }

    #[test]
    fn another_executor_begins_anew_and_depth_goes_on() {
        let auto = QualityRule::Auto(Quality::Balanced);
        let mut picker = Picker::new((auto, Quality::Balanced), 30 * MS, Some(30 * MS), (&[1.0], true));
        for frame in 0..100 {
            let at_ns = frame * 30 * MS;
            picker.note_depth(DepthTimes { effort: Some(0), took_ns: 40 * MS, age_ns: 3 * MS, at_ns });
            picker.note(picker.quality(), 5 * MS, at_ns);
        }
        assert_eq!((picker.plan().frames, picker.expected_ns()), (2, 5 * MS));
        let other = picker.with(auto, Quality::Best);
        assert_eq!((other.plan().frames, other.quality(), other.expected_ns()), (2, Quality::Balanced, 0));
    }
}
