//! Picks the quality level at which frames are blurred, from the time available.

use super::Time;
use crate::bokeh::rung::COSTS;
use crate::budget::{DepthTimes, Plan, Planner, Quality, Sample};
use crate::look::QualityRule;

/// Picks the quality of each frame, and the effort of its depth, from the time available.
pub(crate) struct Picker {
    /// The levels to pick from, cheapest first.
    rungs: &'static [Quality],
    planner: Planner,
}

impl Picker {
    /// Creates a picker. With an automatic rule no level finer than `finest` is used. In real time the effort of depth
    /// follows the time available; frames share depth only if `time` allows it.
    pub(super) fn new((rule, finest): (QualityRule, Quality), time: Time) -> Self {
        let Time { budget_ns, period_ns, efforts, shares_depth } = time;
        let (rungs, costs, places) = Self::ladder(rule, finest);
        Self { rungs, planner: Planner::new((budget_ns, period_ns), (efforts, shares_depth), costs, places) }
    }

    /// Returns a picker for another rule and executor. Measured blur times are dropped, those of depth stay.
    pub(super) fn with(&self, rule: QualityRule, finest: Quality) -> Self {
        let (rungs, costs, places) = Self::ladder(rule, finest);
        Self { rungs, planner: self.planner.with_blur(costs, places) }
    }

    /// Returns the levels that `rule` allows, cheapest first, their relative costs, and the indices of the default and
    /// the first one.
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

    /// Sets the time that a blur may take, in nanoseconds.
    pub fn set_budget(&mut self, budget_ns: u64) {
        self.planner.allow(budget_ns);
    }

    /// Returns the plan for the next frame.
    pub fn plan(&self) -> Plan {
        self.planner.plan()
    }

    /// Returns the quality of the next frame.
    pub fn quality(&self) -> Quality {
        self.rungs[self.plan().level]
    }

    /// Returns the expected blur time of the next frame; 0 if unknown.
    pub fn expected_ns(&self) -> u64 {
        self.planner.expected_blur_ns().unwrap_or(0)
    }

    /// Records the times of a frame's depth.
    pub fn note_depth(&mut self, times: DepthTimes) {
        self.planner.note_depth(times);
    }

    /// Records that a frame was too late.
    pub fn note_late(&mut self) {
        self.planner.note_late();
    }

    /// Records that a blur at `quality` took `took_ns` and finished at `at_ns`.
    pub fn note(&mut self, quality: Quality, took_ns: u64, at_ns: u64) {
        if let Some(rung) = self.rungs.iter().position(|&rung| rung == quality) {
            self.planner.note_blur(Sample { level: rung, took_ns, at_ns });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    const TIME: Time = Time { budget_ns: 30 * MS, period_ns: Some(30 * MS), efforts: &[1.0], shares_depth: true };

    /// Blurs frames that take 4 ms at the usual quality; returns the last quality.
    fn blurred(rule: QualityRule, finest: Quality) -> Quality {
        let mut picker = Picker::new((rule, finest), TIME);
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
        let mut picker = Picker::new((auto, Quality::Balanced), TIME);
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
