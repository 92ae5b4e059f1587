//! How long a stage takes for a frame, as learnt from the last ones.

use super::window::Window;

/// The most rungs that a ladder can have.
pub const MAX_RUNGS: usize = 8;

/// Frames in the history of loads: 1.5 s at 30 fps.
const LOADS: usize = 45;
/// A step up looks only at the newest of these, so that a load that has fallen is soon forgotten. With fewer, no high
/// percentile is taken at all.
pub(super) const RECENT: usize = 20;
/// Percentiles that count as the high load, for steps down and up: rarer spikes are ignored.
const HIGH: f64 = 0.95;
const HIGH_RECENT: f64 = 0.9;
/// The median of a few loads times this stands for a high percentile, so that a jump of the load is seen at once.
const ABOVE_MEDIAN: f64 = 1.1;
/// Frames at a rung before its cost is learnt, the fewest if it is left earlier, and the exponent that damps the
/// correction.
pub(super) const LEARN_FROM: usize = 8;
pub(super) const LEARN_LEAST: usize = 3;
const LEARN_SHARE: f64 = 0.3;
/// No learnt cost is farther than this factor from the initial one, either way.
pub(super) const LEARN_MOST: f64 = 3.0;
/// After a pause this long the old loads say nothing: clocks have slowed down and caches are cold.
pub(super) const IDLE_NS: u64 = 2_000_000_000;

/// The time measured for one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// The rung that it was made at.
    pub rung: usize,
    /// Its time; 0 means that it was not measured.
    pub took_ns: u64,
    /// When it was done.
    pub at_ns: u64,
}

/// A frame's time as `load * cost(rung)`, of a stage. Memory is fixed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Load {
    /// Ascending, as learnt; infinite from `rungs` on.
    costs: [f64; MAX_RUNGS],
    initial_costs: [f64; MAX_RUNGS],
    rungs: usize,
    rung: usize,
    /// Time divided by cost, in nanoseconds, of the last frames of any rung.
    loads: Window<LOADS>,
    /// The same of the frames since the rung changed, at this rung only.
    rung_loads: Window<LEARN_FROM>,
    /// The load just before the rung changed, until the new rung's cost has been learnt from it.
    load_before: Option<f64>,
    /// The latest time of any sample.
    last_ns: u64,
}

/// What a sample was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Noted {
    /// Of no use.
    Nothing,
    /// Of another rung than the present one.
    Other,
    /// Of the present rung.
    Own,
}

impl Load {
    /// Of a stage with these relative costs, the cheapest first, that starts at rung `start`.
    pub fn new(ladder: &[f64], start: usize) -> Self {
        assert!((1..=MAX_RUNGS).contains(&ladder.len()) && start < ladder.len(), "1 to {MAX_RUNGS} rungs");
        assert!(ladder[0] > 0.0 && ladder.is_sorted(), "costs ascend from above 0: {ladder:?}");
        let mut costs = [f64::INFINITY; MAX_RUNGS];
        costs[..ladder.len()].copy_from_slice(ladder);
        Self {
            costs,
            initial_costs: costs,
            rungs: ladder.len(),
            rung: start,
            loads: Window::default(),
            rung_loads: Window::default(),
            load_before: None,
            last_ns: 0,
        }
    }

    /// The relative costs as learnt, the cheapest first.
    pub fn costs(&self) -> &[f64] {
        &self.costs[..self.rungs]
    }

    /// How long the next frame is likely to take, in nanoseconds; `None` before the first sample.
    pub fn expected_ns(&self) -> Option<u64> {
        (!self.loads.is_empty()).then(|| (self.loads.median(5) * self.costs[self.rung]) as u64)
    }

    /// Whether so much time has passed that what was measured says nothing.
    pub fn was_idle(&self, at_ns: u64) -> bool {
        at_ns.saturating_sub(self.last_ns) > IDLE_NS
    }

    /// Takes in a frame's time.
    pub fn note(&mut self, Sample { rung, took_ns, at_ns }: Sample) -> Noted {
        if took_ns == 0 || rung >= self.rungs {
            return Noted::Nothing;
        }
        if self.was_idle(at_ns) {
            self.forget();
        }
        self.last_ns = self.last_ns.max(at_ns);
        let load = took_ns as f64 / self.costs[rung];
        self.loads.push(load);
        if rung != self.rung {
            return Noted::Other;
        }
        self.rung_loads.push(load);
        if self.rung_loads.len() == LEARN_FROM {
            self.learn();
        }
        Noted::Own
    }

    /// The load that nearly all frames stayed below, and that of the newest ones; and what is usual now.
    pub fn high(&self) -> ([f64; 2], f64) {
        let current = ABOVE_MEDIAN * self.loads.median(5);
        ([(LOADS, HIGH), (RECENT, HIGH_RECENT)].map(|(count, p)| self.percentile(count, p).max(current)), current)
    }

    /// The load that a fraction `p` of the last `count` frames does not exceed; 0 after fewer than [`RECENT`] frames,
    /// because the first ones are slow while caches are cold.
    fn percentile(&self, count: usize, p: f64) -> f64 {
        if self.loads.len() < RECENT { 0.0 } else { self.loads.percentile(count, p) }
    }

    /// Changes to the rung `to`, and first learns the cost of the one that is left.
    pub fn switch_to(&mut self, to: usize) {
        self.learn();
        self.load_before = (!self.rung_loads.is_empty()).then(|| self.rung_loads.median(5));
        self.rung = to;
        self.rung_loads.clear();
    }

    /// Corrects the cost of the present rung. A change of rung should leave the load as it is, so part of any jump is
    /// put down to a wrong cost.
    fn learn(&mut self) {
        if self.rung_loads.len() < LEARN_LEAST {
            return;
        }
        let Some(before) = self.load_before.take() else { return };
        let (rung, ratio) = (self.rung, self.rung_loads.median(LEARN_FROM) / before);
        let (low, high) = (self.initial_costs[rung] / LEARN_MOST, self.initial_costs[rung] * LEARN_MOST);
        // The costs must stay ascending.
        let below = if rung > 0 { self.costs[rung - 1] } else { 0.0 };
        let above = if rung + 1 < self.rungs { self.costs[rung + 1] } else { f64::INFINITY };
        self.costs[rung] = (self.costs[rung] * ratio.powf(LEARN_SHARE)).clamp(low.max(below), high.min(above));
    }

    /// Keeps the rung and the costs, and forgets what the load was.
    fn forget(&mut self) {
        self.loads.clear();
        self.rung_loads.clear();
        self.load_before = None;
    }
}
