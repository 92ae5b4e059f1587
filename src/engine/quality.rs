//! How finely frames are blurred: what there is time for.

use super::Time;
use crate::bokeh::rung::COSTS;
use crate::budget::{DepthTimes, Plan, Planner, Quality, Sample};
use crate::look::QualityRule;

/// Picks the quality of each frame, and how depth is made, by the time there is.
pub(crate) struct Picker {
    /// The rungs to pick from, cheapest first.
    rungs: &'static [Quality],
    planner: Planner,
}

impl Picker {
    /// No frame is blurred more finely than `finest` unless that was asked for; in real time, depth is made as there is time,
    /// and shared by frames only where it may be.
    pub(super) fn new((rule, finest): (QualityRule, Quality), time: Time) -> Self {
        let Time { budget_ns, period_ns, efforts, shares_depth } = time;
        let (rungs, costs, places) = Self::ladder(rule, finest);
        Self { rungs, planner: Planner::new((budget_ns, period_ns), (efforts, shares_depth), costs, places) }
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
    pub fn allow(&mut self, budget_ns: u64) {
        self.planner.allow(budget_ns);
    }

    /// What the next frame gets.
    pub fn plan(&self) -> Plan {
        self.planner.plan()
    }

    /// The quality of the next frame.
    pub fn quality(&self) -> Quality {
        self.rungs[self.plan().rung]
    }

    /// How long the blur of the next frame is likely to take; 0 before anything is known.
    pub fn expected_ns(&self) -> u64 {
        self.planner.expected_blur_ns().unwrap_or(0)
    }

    /// The depth of a frame took so long.
    pub fn note_depth(&mut self, times: DepthTimes) {
        self.planner.note_depth(times);
    }

    /// A frame came too late.
    pub fn note_late(&mut self) {
        self.planner.note_late();
    }

    /// A frame of this quality took so long to blur, and was done at `at_ns`.
    pub fn note(&mut self, quality: Quality, took_ns: u64, at_ns: u64) {
        if let Some(rung) = self.rungs.iter().position(|&rung| rung == quality) {
            self.planner.note_blur(Sample { rung, took_ns, at_ns });
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
