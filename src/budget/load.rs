//! Model of a stage's time per frame, learnt from the last frames.

use super::window::Window;

/// Largest number of quality levels of a ladder.
pub const MAX_LEVELS: usize = 8;

/// Frames in the history of loads: 1.5 s at 30 fps.
const LOAD_WINDOW: usize = 45;
/// A step up considers only this many of the newest loads, so that a past load is soon forgotten. With fewer loads, no
/// high percentile is computed.
pub(super) const RECENT_LOADS: usize = 20;
/// Percentiles that count as the high load, for steps down and up: rarer spikes are ignored.
const HIGH_PERCENTILE: f64 = 0.95;
const RECENT_HIGH_PERCENTILE: f64 = 0.9;
/// The median of a few loads times this estimates a high percentile, so that a rise of the load is seen at once.
const MEDIAN_MARGIN: f64 = 1.1;
/// Frames at a level before its cost is learnt, the minimum if it is left earlier, and the exponent that damps the
/// correction.
pub(super) const LEARN_FRAMES: usize = 8;
pub(super) const MIN_LEARN_FRAMES: usize = 3;
const LEARN_EXPONENT: f64 = 0.3;
/// Largest ratio of a learnt cost to the initial one, either way.
pub(super) const MAX_COST_RATIO: f64 = 3.0;
/// After a pause this long the old loads are invalid: clocks have slowed down and caches are cold.
pub(super) const IDLE_NS: u64 = 2_000_000_000;

/// The time measured for one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// Quality level of the frame.
    pub level: usize,
    /// Its time; 0 if it was not measured.
    pub took_ns: u64,
    /// Time at which it was finished.
    pub at_ns: u64,
}

/// Model of a stage's time per frame: `load * cost(level)`. Fixed size.
#[derive(Clone, Copy, Debug)]
pub(super) struct LoadModel {
    /// Learnt costs, ascending; infinite from `levels` on.
    costs: [f64; MAX_LEVELS],
    initial_costs: [f64; MAX_LEVELS],
    levels: usize,
    level: usize,
    /// Time divided by cost, in nanoseconds, of the last frames of any level.
    loads: Window<LOAD_WINDOW>,
    /// Same, only for frames at the present level since it was set.
    level_loads: Window<LEARN_FRAMES>,
    /// Load just before the level changed, until the new level's cost has been learnt from it.
    load_before: Option<f64>,
    /// Latest time of any sample.
    last_ns: u64,
}

/// Classification of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SampleKind {
    /// Invalid.
    Invalid,
    /// At another level than the present one.
    OtherLevel,
    /// At the present level.
    PresentLevel,
}

impl LoadModel {
    /// Creates the model of a stage with these relative costs, cheapest first, that starts at level `start`.
    pub fn new(ladder: &[f64], start: usize) -> Self {
        assert!((1..=MAX_LEVELS).contains(&ladder.len()) && start < ladder.len(), "1 to {MAX_LEVELS} rungs");
        assert!(ladder[0] > 0.0 && ladder.is_sorted(), "costs ascend from above 0: {ladder:?}");
        let mut costs = [f64::INFINITY; MAX_LEVELS];
        costs[..ladder.len()].copy_from_slice(ladder);
        Self {
            costs,
            initial_costs: costs,
            levels: ladder.len(),
            level: start,
            loads: Window::default(),
            level_loads: Window::default(),
            load_before: None,
            last_ns: 0,
        }
    }

    /// Returns the learnt relative costs, cheapest first.
    pub fn costs(&self) -> &[f64] {
        &self.costs[..self.levels]
    }

    /// Returns the expected time of the next frame, in nanoseconds; `None` before the first sample.
    pub fn expected_ns(&self) -> Option<u64> {
        (!self.loads.is_empty()).then(|| (self.loads.median(5) * self.costs[self.level]) as u64)
    }

    /// Whether the pause before `at_ns` was so long that the old loads are invalid.
    pub fn was_idle(&self, at_ns: u64) -> bool {
        at_ns.saturating_sub(self.last_ns) > IDLE_NS
    }

    /// Adds a frame's time.
    pub fn record(&mut self, Sample { level, took_ns, at_ns }: Sample) -> SampleKind {
        if took_ns == 0 || level >= self.levels {
            return SampleKind::Invalid;
        }
        if self.was_idle(at_ns) {
            self.clear_loads();
        }
        self.last_ns = self.last_ns.max(at_ns);
        let load = took_ns as f64 / self.costs[level];
        self.loads.push(load);
        if level != self.level {
            return SampleKind::OtherLevel;
        }
        self.level_loads.push(load);
        if self.level_loads.len() == LEARN_FRAMES {
            self.learn_cost();
        }
        SampleKind::PresentLevel
    }

    /// Returns the high load of all and of the newest frames, and the usual load now.
    pub fn high_and_usual(&self) -> ([f64; 2], f64) {
        let current = MEDIAN_MARGIN * self.loads.median(5);
        (
            [(LOAD_WINDOW, HIGH_PERCENTILE), (RECENT_LOADS, RECENT_HIGH_PERCENTILE)]
                .map(|(count, p)| self.percentile(count, p).max(current)),
            current,
        )
    }

    /// Returns the load that a fraction `p` of the last `count` frames does not exceed; 0 after fewer than [`RECENT_LOADS`]
    /// frames, because the first ones are slow while caches are cold.
    fn percentile(&self, count: usize, p: f64) -> f64 {
        if self.loads.len() < RECENT_LOADS { 0.0 } else { self.loads.percentile(count, p) }
    }

    /// Changes to level `to`, after learning the cost of the previous one.
    pub fn switch_to(&mut self, to: usize) {
        self.learn_cost();
        self.load_before = (!self.level_loads.is_empty()).then(|| self.level_loads.median(5));
        self.level = to;
        self.level_loads.clear();
    }

    /// Corrects the cost of the present level. A change of level should leave the load as it is, so part of any change
    /// of the load is attributed to a wrong cost.
    fn learn_cost(&mut self) {
        if self.level_loads.len() < MIN_LEARN_FRAMES {
            return;
        }
        let Some(before) = self.load_before.take() else { return };
        let (level, ratio) = (self.level, self.level_loads.median(LEARN_FRAMES) / before);
        let (low, high) = (self.initial_costs[level] / MAX_COST_RATIO, self.initial_costs[level] * MAX_COST_RATIO);
        // The costs must stay ascending.
        let below = if level > 0 { self.costs[level - 1] } else { 0.0 };
        let above = if level + 1 < self.levels { self.costs[level + 1] } else { f64::INFINITY };
        self.costs[level] = (self.costs[level] * ratio.powf(LEARN_EXPONENT)).clamp(low.max(below), high.min(above));
    }

    /// Forgets the loads; keeps the level and the costs.
    fn clear_loads(&mut self) {
        self.loads.clear();
        self.level_loads.clear();
        self.load_before = None;
    }
}
