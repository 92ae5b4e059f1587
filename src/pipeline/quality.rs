//! Which frames are blurred, and how finely: what there is time for.

use crate::bokeh::rung::COSTS;
use crate::budget::{Governor, Quality, Sample, Window};
use crate::look::QualityRule;

/// Periods after capture at which a frame is to be delivered at the latest.
const DEADLINE_PERIODS: u64 = 2;
/// Tenths of that by which the blur is to be done: the rest is for the way to the sink and for bad luck.
const DEADLINE_TENTHS: u64 = 8;
/// Frames whose ages are remembered: three seconds at 30 fps.
const AGES: usize = 90;

/// The first frames are old, as all that makes them is made then.
const WARMING_UP: usize = 8;

/// So long after its capture, the blur of a frame is to be done.
pub(super) fn deadline_ns(period_ns: u64) -> u64 {
    DEADLINE_PERIODS * period_ns * DEADLINE_TENTHS / 10
}

/// Picks the quality of each frame by the time there is.
pub(super) struct Picker {
    /// The rungs to pick from, cheapest first.
    rungs: &'static [Quality],
    governor: Governor,
    budget_ns: u64,
    deadline_ns: Option<u64>,
    /// Frames that were begun, up to [`WARMING_UP`].
    begun: usize,
    /// Ages of the last frames when their blur began.
    ages: Window<AGES>,
}

impl Picker {
    /// Frames may take `budget_ns`; where they come every `period_ns` in real time, there is a deadline, too. None is
    /// blurred more finely than `finest` unless that was asked for.
    pub(super) fn new(rule: QualityRule, finest: Quality, budget_ns: u64, period_ns: Option<u64>) -> Self {
        let (rungs, governor) = Self::rungs_and_governor(rule, finest);
        let deadline_ns = period_ns.map(deadline_ns);
        Self { rungs, governor, budget_ns, deadline_ns, begun: 0, ages: Window::default() }
    }

    /// The same under another rule, for another executor. What was learnt of the time that rungs take holds no more.
    pub(super) fn with(&self, rule: QualityRule, finest: Quality) -> Self {
        let (rungs, governor) = Self::rungs_and_governor(rule, finest);
        let &Self { budget_ns, deadline_ns, .. } = self;
        Self { rungs, governor, budget_ns, deadline_ns, begun: 0, ages: Window::default() }
    }

    /// The qualities that `rule` allows, cheapest first, and a governor that climbs them.
    fn rungs_and_governor(rule: QualityRule, finest: Quality) -> (&'static [Quality], Governor) {
        let at = |quality: Quality| quality as usize;
        match rule {
            QualityRule::Fixed(quality) => (&Quality::ALL[at(quality)..=at(quality)], Governor::new(&[1.0], 0)),
            QualityRule::Auto(start) => {
                (&Quality::ALL[..=at(finest)], Governor::new(&COSTS[..=at(finest)], at(start.min(finest))))
            }
        }
    }

    /// The quality of the next frame.
    pub(super) fn quality(&self) -> Quality {
        self.rungs[self.governor.rung()]
    }

    /// How long the next frame is likely to take; 0 before anything is known.
    pub(super) fn expected_ns(&self) -> u64 {
        self.governor.expected_ns().unwrap_or(0)
    }

    /// How long a frame of the default quality is likely to take, or of the finest one below it that there is; `None` before
    /// anything is known.
    pub(super) fn usual_ns(&self) -> Option<u64> {
        let usual = self.rungs.iter().rposition(|&rung| rung <= Quality::default()).unwrap_or(0);
        let costs = self.governor.costs();
        let ns = self.governor.expected_ns()? as f64 * costs[usual] / costs[self.governor.rung()];
        Some(ns as u64)
    }

    /// The blur of a frame of this age begins.
    pub(super) fn begin(&mut self, age_ns: u64) {
        self.begun = (self.begun + 1).min(WARMING_UP);
        if self.begun == WARMING_UP {
            self.ages.push(age_ns as f64);
        }
    }

    /// A frame of this quality took so long, and was done at `at_ns`.
    pub(super) fn note(&mut self, quality: Quality, took_ns: u64, at_ns: u64) {
        let Some(rung) = self.rungs.iter().position(|&rung| rung == quality) else { return };
        self.governor.note(Sample { rung, took_ns, at_ns }, self.allowed_ns());
    }

    /// What a frame may take: the budget, or what is left until the deadline where that is less. Never next to
    /// nothing: where frames are old before their blur begins, a cheaper blur saves little.
    fn allowed_ns(&self) -> u64 {
        let left_ns = self.deadline_ns.map(|ns| ns.saturating_sub(self.ages.percentile(AGES, 0.95) as u64));
        left_ns.map_or(self.budget_ns, |left_ns| left_ns.clamp(self.budget_ns / 4, self.budget_ns))
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

    #[test]
    fn the_deadline_leaves_less_time_where_frames_are_old_when_they_come() {
        let period_ns = 30 * MS;
        for (age_ns, expected) in [(10 * MS, Quality::Best), (30 * MS, Quality::Balanced), (70 * MS, Quality::Draft)] {
            let mut picker =
                Picker::new(QualityRule::Auto(Quality::Balanced), Quality::Best, period_ns, Some(period_ns));
            for frame in 0..200 {
                picker.begin(age_ns);
                let quality = picker.quality();
                // The default takes 13 ms.
                let took_ns = (COSTS[quality as usize] * 13.0 * MS as f64) as u64;
                picker.note(quality, took_ns, frame * period_ns);
            }
            assert_eq!(picker.quality(), expected, "{age_ns}");
        }
    }

    #[test]
    fn however_old_frames_are_their_blur_has_a_quarter_of_the_budget() {
        let mut picker = Picker::new(QualityRule::Auto(Quality::Balanced), Quality::Best, 30 * MS, Some(30 * MS));
        for frame in 0..200 {
            picker.begin(500 * MS);
            let quality = picker.quality();
            // The default takes 4 ms, and the finest 7.7: more than a quarter of the budget leaves free.
            picker.note(quality, (COSTS[quality as usize] * 4.0 * MS as f64) as u64, frame * 30 * MS);
        }
        assert_eq!(picker.quality(), Quality::High);
    }

    #[test]
    fn auto_goes_no_further_than_it_may() {
        let mut picker = Picker::new(QualityRule::Auto(Quality::Best), Quality::Balanced, 30 * MS, None);
        (0..100).for_each(|frame| picker.note(picker.quality(), MS, frame * 30 * MS));
        assert_eq!(picker.quality(), Quality::Balanced);
    }

    #[test]
    fn a_fixed_quality_stays() {
        let mut picker = Picker::new(QualityRule::Fixed(Quality::High), Quality::Balanced, MS, Some(MS));
        (0..100).for_each(|frame| picker.note(Quality::High, 50 * MS, frame * MS));
        assert_eq!((picker.quality(), picker.expected_ns()), (Quality::High, 50 * MS));
    }
}
