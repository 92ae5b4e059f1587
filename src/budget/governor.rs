//! The governor, a quality controller with hysteresis: it picks the finest rung that stays within the time budget.
//!
//! A frame's time is modelled as `load * cost(rung)`: the current load times the rung's relative cost. Loads of frames
//! of different rungs are therefore comparable, and the time of any rung can be predicted before it is tried. A step
//! down is immediate; a step up needs a run of frames with time to spare, and a longer run after each step up that had
//! to be undone soon. The costs are learnt: if the load seems to jump whenever the rung changes, the cost is wrong.

use super::window::Window;

/// The most rungs that a ladder can have.
pub const MAX_RUNGS: usize = 8;

/// Frames in the history of loads: 1.5 s at 30 fps.
const LOADS: usize = 45;
/// A step up looks only at the newest of these, so that a load that has fallen is soon forgotten. With fewer, no high
/// percentile is taken at all.
const RECENT: usize = 20;
/// Percentiles that count as the high load, for steps down and up: rarer spikes are ignored.
const HIGH: f64 = 0.95;
const HIGH_RECENT: f64 = 0.9;
/// Shares of the budget: the rung is kept up to the first; a step down must fit the second, a step up the third.
/// Without these gaps, noise alone would drive the rung up and down.
const KEEP: f64 = 1.03;
const AIM_DOWN: f64 = 0.97;
const AIM_UP: f64 = 0.95;
/// The median of a few loads times this stands for a high percentile, so that a jump of the load is seen at once.
const ABOVE_MEDIAN: f64 = 1.1;
/// Consecutive frames with time to spare before a step up: at first, and at most after steps up that were undone.
const PATIENCE: u32 = 30;
const MOST_PATIENCE: u32 = 960;
/// A step up that is undone within this many times the patience doubles the patience.
const REGRET: u32 = 2;
/// Frames at a rung before its cost is learnt, the fewest if it is left earlier, and the exponent that damps the
/// correction.
const LEARN_FROM: usize = 8;
const LEARN_LEAST: usize = 3;
const LEARN_SHARE: f64 = 0.3;
/// No learnt cost is farther than this factor from the initial one, either way.
const LEARN_MOST: f64 = 3.0;
/// After a pause this long the old loads say nothing: clocks have slowed down and caches are cold.
const IDLE_NS: u64 = 2_000_000_000;

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

/// Picks the rung of a ladder by the times of the last frames. Memory is fixed.
#[derive(Clone, Debug)]
pub struct Governor {
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
    /// Consecutive frames with time to spare, and the finest rung that all of them would have allowed.
    surplus: u32,
    surplus_rung: usize,
    /// The `surplus` that a step up needs.
    patience: u32,
    /// Frames since the rung changed, and whether that was upwards.
    frames_at_rung: u32,
    went_up: bool,
}

impl Governor {
    /// A governor of a ladder with these relative costs, the cheapest first, that starts at rung `start`.
    ///
    /// # Panics
    /// There is no rung, there are more than [`MAX_RUNGS`], or the costs are not positive and ascending.
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
            surplus: 0,
            surplus_rung: start,
            patience: PATIENCE,
            frames_at_rung: 0,
            went_up: false,
        }
    }

    /// The rung for the next frame.
    pub fn rung(&self) -> usize {
        self.rung
    }

    /// The relative costs as learnt, the cheapest first.
    pub fn costs(&self) -> &[f64] {
        &self.costs[..self.rungs]
    }

    /// How long the next frame is likely to take, in nanoseconds; `None` before the first sample.
    pub fn expected_ns(&self) -> Option<u64> {
        (!self.loads.is_empty()).then(|| (self.loads.median(5) * self.costs[self.rung]) as u64)
    }

    /// Takes in one frame's time and chooses the rung for the next frame: the finest that stays within `budget_ns`.
    /// Samples may come late: one of another rung than the present one only adds to the loads.
    pub fn note(&mut self, sample: Sample, budget_ns: u64) {
        let Sample { rung, took_ns, at_ns } = sample;
        if took_ns == 0 || rung >= self.rungs {
            return;
        }
        if at_ns.saturating_sub(self.last_ns) > IDLE_NS {
            self.forget();
        }
        self.last_ns = self.last_ns.max(at_ns);
        let load = took_ns as f64 / self.costs[rung];
        self.loads.push(load);
        if rung != self.rung {
            return;
        }
        self.rung_loads.push(load);
        self.frames_at_rung = self.frames_at_rung.saturating_add(1);
        if self.rung_loads.len() == LEARN_FROM {
            self.learn();
        }
        if self.went_up && self.frames_at_rung >= REGRET * self.patience {
            // The step up has held: the next one needs no more than the usual patience.
            (self.patience, self.went_up) = (PATIENCE, false);
        }
        let budget_ns = budget_ns as f64;
        let current_load = ABOVE_MEDIAN * self.loads.median(5);
        let high_load = self.load_percentile(LOADS, HIGH).max(current_load);
        // One or two frames at a rung prove nothing.
        if self.rung_loads.len() >= LEARN_LEAST && high_load * self.costs[self.rung] > KEEP * budget_ns {
            let to = self.finest_within(high_load, AIM_DOWN * budget_ns);
            if to < self.rung {
                return self.switch_to(to);
            }
        }
        let recent_load = self.load_percentile(RECENT, HIGH_RECENT).max(current_load);
        let to = self.finest_within(recent_load, AIM_UP * budget_ns);
        if to <= self.rung {
            self.surplus = 0;
            return;
        }
        self.surplus_rung = if self.surplus == 0 { to } else { self.surplus_rung.min(to) };
        self.surplus += 1;
        if self.surplus >= self.patience {
            self.switch_to(self.surplus_rung);
        }
    }

    /// The load that a fraction `p` of the last `count` frames does not exceed; 0 after fewer than [`RECENT`] frames,
    /// because the first ones are slow while caches are cold.
    fn load_percentile(&self, count: usize, p: f64) -> f64 {
        if self.loads.len() < RECENT { 0.0 } else { self.loads.percentile(count, p) }
    }

    /// The finest rung that takes no longer than `limit_ns` at this load; the cheapest if none does.
    fn finest_within(&self, load: f64, limit_ns: f64) -> usize {
        self.costs().iter().rposition(|cost| cost * load <= limit_ns).unwrap_or(0)
    }

    /// Changes to the rung `to`, and first learns the cost of the one that is left. A step down soon after a step up
    /// doubles the patience.
    fn switch_to(&mut self, to: usize) {
        self.learn();
        if to < self.rung && self.went_up && self.frames_at_rung < REGRET * self.patience {
            self.patience = (2 * self.patience).min(MOST_PATIENCE);
        }
        self.load_before = (!self.rung_loads.is_empty()).then(|| self.rung_loads.median(5));
        self.went_up = to > self.rung;
        (self.rung, self.frames_at_rung, self.surplus) = (to, 0, 0);
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
        (self.surplus, self.frames_at_rung, self.went_up, self.patience) = (0, 0, false, PATIENCE);
    }
}

#[cfg(test)]
mod tests;
