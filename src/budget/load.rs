//! Model of a stage's time per frame, learnt from the last frames.

use super::window::Window;

/// Largest number of quality levels of a ladder.
pub const MAX_LEVELS: usize = 8;

/// Frames in the history of loads: 1.5 s at 30 fps.
const LOADS: usize = 45;
/// A step up considers only this many of the newest loads, so that a past load is soon forgotten. With fewer loads, no
/// high percentile is computed.
pub(super) const RECENT: usize = 20;
/// Percentiles that count as the high load, for steps down and up: rarer spikes are ignored.
const HIGH: f64 = 0.95;
const HIGH_RECENT: f64 = 0.9;
/// The median of a few loads times this estimates a high percentile, so that a rise of the load is seen at once.
const ABOVE_MEDIAN: f64 = 1.1;
/// Frames at a level before its cost is learnt, the minimum if it is left earlier, and the exponent that damps the
/// correction.
pub(super) const LEARN_FROM: usize = 8;
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
pub(super) struct Load {
    /// Learnt costs, ascending; infinite from `rungs` on.
    costs: [f64; MAX_LEVELS],
    initial_costs: [f64; MAX_LEVELS],
    rungs: usize,
    level: usize,
    /// Time divided by cost, in nanoseconds, of the last frames of any level.
    loads: Window<LOADS>,
    /// Same, only for frames at the present level since it was set.
    rung_loads: Window<LEARN_FROM>,
    /// Load just before the level changed, until the new level's cost has been learnt from it.
    load_before: Option<f64>,
    /// Latest time of any sample.
    last_ns: u64,
}

/// Classification of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SampleKind {
    /// Invalid.
    Nothing,
    /// At another level than the present one.
    Other,
    /// At the present level.
    Own,
}

impl Load {
    /// Creates the model of a stage with these relative costs, cheapest first, that starts at level `start`.
    pub fn new(ladder: &[f64], start: usize) -> Self {
        assert!((1..=MAX_LEVELS).contains(&ladder.len()) && start < ladder.len(), "1 to {MAX_LEVELS} rungs");
        assert!(ladder[0] > 0.0 && ladder.is_sorted(), "costs ascend from above 0: {ladder:?}");
        let mut costs = [f64::INFINITY; MAX_LEVELS];
        costs[..ladder.len()].copy_from_slice(ladder);
        Self {
            costs,
            initial_costs: costs,
            rungs: ladder.len(),
            level: start,
            loads: Window::default(),
            rung_loads: Window::default(),
            load_before: None,
            last_ns: 0,
        }
    }

    /// Returns the learnt relative costs, cheapest first.
    pub fn costs(&self) -> &[f64] {
        &self.costs[..self.rungs]
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
    pub fn note(&mut self, Sample { level, took_ns, at_ns }: Sample) -> SampleKind {
        if took_ns == 0 || level >= self.rungs {
            return SampleKind::Nothing;
        }
        if self.was_idle(at_ns) {
            self.forget();
        }
        self.last_ns = self.last_ns.max(at_ns);
        let load = took_ns as f64 / self.costs[level];
        self.loads.push(load);
        if level != self.level {
            return SampleKind::Other;
        }
        self.rung_loads.push(load);
        if self.rung_loads.len() == LEARN_FROM {
            self.learn();
        }
        SampleKind::Own
    }

    /// Returns the high load of all and of the newest frames, and the usual load now.
    pub fn high(&self) -> ([f64; 2], f64) {
        let current = ABOVE_MEDIAN * self.loads.median(5);
        ([(LOADS, HIGH), (RECENT, HIGH_RECENT)].map(|(count, p)| self.percentile(count, p).max(current)), current)
    }

    /// Returns the load that a fraction `p` of the last `count` frames does not exceed; 0 after fewer than [`RECENT`]
    /// frames, because the first ones are slow while caches are cold.
    fn percentile(&self, count: usize, p: f64) -> f64 {
        if self.loads.len() < RECENT { 0.0 } else { self.loads.percentile(count, p) }
    }

    /// Changes to level `to`, after learning the cost of the previous one.
    pub fn switch_to(&mut self, to: usize) {
        self.learn();
        self.load_before = (!self.rung_loads.is_empty()).then(|| self.rung_loads.median(5));
        self.level = to;
        self.rung_loads.clear();
    }

    /// Corrects the cost of the present level. A change of level should leave the load as it is, so part of any change
    /// of the load is attributed to a wrong cost.
    fn learn(&mut self) {
        if self.rung_loads.len() < MIN_LEARN_FRAMES {
            return;
        }
        let Some(before) = self.load_before.take() else { return };
        let (level, ratio) = (self.level, self.rung_loads.median(LEARN_FROM) / before);
        let (low, high) = (self.initial_costs[level] / MAX_COST_RATIO, self.initial_costs[level] * MAX_COST_RATIO);
        // The costs must stay ascending.
        let below = if level > 0 { self.costs[level - 1] } else { 0.0 };
        let above = if level + 1 < self.rungs { self.costs[level + 1] } else { f64::INFINITY };
        self.costs[level] = (self.costs[level] * ratio.powf(LEARN_EXPONENT)).clamp(low.max(below), high.min(above));
    }

    /// Forgets the loads; keeps the level and the costs.
    fn forget(&mut self) {
        self.loads.clear();
        self.rung_loads.clear();
        self.load_before = None;
    }
}
