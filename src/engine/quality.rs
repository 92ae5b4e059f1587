//! Picks the quality level at which frames are blurred, from the time available.

use super::TimeBudget;
use crate::bokeh::quality_level::COSTS;
use crate::budget::{DepthTimes, Plan, Planner, Quality, Sample};
use crate::look::QualityRule;

/// Picks the quality of each frame, and the effort of its depth, from the time available.
pub struct QualityPicker {
    /// The levels to pick from, cheapest first.
    levels: &'static [Quality],
    planner: Planner,
}

impl QualityPicker {
    /// Creates a picker. With an automatic rule no level finer than `finest` is used. In real time the effort of depth
    /// follows the time available; frames share depth only if `time` allows it.
    pub(super) fn new((rule, finest): (QualityRule, Quality), time: TimeBudget) -> Self {
        let TimeBudget { budget_ns, period_ns, efforts, shares_depth } = time;
        let (levels, costs, indices) = Self::allowed_levels(rule, finest);
        Self { levels, planner: Planner::new(budget_ns, period_ns, efforts, shares_depth, costs, indices) }
    }

    /// Returns a picker for another rule and executor. Measured blur times are dropped, those of depth stay.
    pub(super) fn with_rule(&self, rule: QualityRule, finest: Quality) -> Self {
        let (levels, costs, indices) = Self::allowed_levels(rule, finest);
        Self { levels, planner: self.planner.with_blur(costs, indices) }
    }

    /// Returns the levels that `rule` allows, cheapest first, their relative costs, and the indices of the default and
    /// the first one.
    fn allowed_levels(rule: QualityRule, finest: Quality) -> (&'static [Quality], &'static [f64], [usize; 2]) {
        let at = |quality: Quality| quality as usize;
        match rule {
            QualityRule::Fixed(quality) => (&Quality::ALL[at(quality)..=at(quality)], &[1.0], [0, 0]),
            QualityRule::Auto(start) => {
                let indices = [Quality::default(), start].map(|quality| at(quality.min(finest)));
                (&Quality::ALL[..=at(finest)], &COSTS[..=at(finest)], indices)
            }
        }
    }

    /// Sets the time that a blur may take, in nanoseconds.
    pub fn set_budget(&mut self, budget_ns: u64) {
        self.planner.set_budget(budget_ns);
    }

    /// Returns the plan for the next frame.
    pub fn plan(&self) -> Plan {
        self.planner.plan()
    }

    /// Returns the quality of the next frame.
    pub fn quality(&self) -> Quality {
        self.levels[self.plan().level]
    }

    /// Returns the expected blur time of the next frame; 0 if unknown.
    pub fn expected_blur_ns(&self) -> u64 {
        self.planner.expected_blur_ns().unwrap_or(0)
    }

    /// Records the times of a frame's depth.
    pub fn record_depth(&mut self, times: DepthTimes) {
        self.planner.record_depth(times);
    }

    /// Records that a frame was too late.
    pub fn record_late_frame(&mut self) {
        self.planner.record_late_frame();
    }

    /// Records that a blur at `quality` took `took_ns` and finished at `at_ns`.
    pub fn record_blur(&mut self, quality: Quality, took_ns: u64, at_ns: u64) {
        if let Some(level) = self.levels.iter().position(|&level| level == quality) {
            self.planner.record_blur(Sample { level, took_ns, at_ns });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    const TIME: TimeBudget =
        TimeBudget { budget_ns: 30 * MS, period_ns: Some(30 * MS), efforts: &[1.0], shares_depth: true };

    /// Blurs frames that take 4 ms at the usual quality; returns the last quality.
    fn blurred(rule: QualityRule, finest: Quality) -> Quality {
        let mut picker = QualityPicker::new((rule, finest), TIME);
        for frame in 0..200 {
            let quality = picker.quality();
            picker.record_blur(quality, (COSTS[quality as usize] * 4.0 * MS as f64) as u64, frame * 30 * MS);
        }
        picker.quality()
    }

    #[test]
    fn auto_goes_as_far_as_it_may_and_a_fixed_quality_stays() {
        assert_eq!(blurred(QualityRule::Auto(Quality::Draft), Quality::Best), Quality::Best);
        assert_eq!(blurred(QualityRule::Auto(Quality::Best), Quality::Balanced), Quality::Balanced);
        assert_eq!(blurred(QualityRule::Fixed(Quality::Draft), Quality::Best), Quality::Draft);
    }

    #[test]
    fn another_executor_begins_anew_and_depth_goes_on() {
        let auto = QualityRule::Auto(Quality::Balanced);
        let mut picker = QualityPicker::new((auto, Quality::Balanced), TIME);
        for frame in 0..100 {
            let at_ns = frame * 30 * MS;
            picker.record_depth(DepthTimes { effort: Some(0), took_ns: 40 * MS, age_ns: 3 * MS, at_ns });
            picker.record_blur(picker.quality(), 5 * MS, at_ns);
        }
        assert_eq!((picker.plan().frames, picker.expected_blur_ns()), (2, 5 * MS));
        let other = picker.with_rule(auto, Quality::Best);
        assert_eq!((other.plan().frames, other.quality(), other.expected_blur_ns()), (2, Quality::Balanced, 0));
    }
}
