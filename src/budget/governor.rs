//! The governor, a quality controller with hysteresis: the finest rung that keeps its time.
//!
//! The time of a frame is taken as `load * cost(rung)`, the rung's relative cost times the load of the moment, which
//! makes frames of all rungs comparable. What a rung would take is then known before it is tried. Down goes at once,
//! to the rung that will do; up goes only after a while of nothing but surplus, and after ever longer ones where that
//! was taken back soon. The costs are learnt: where the load seems to jump whenever the rung changes, it is the cost
//! that is wrong.

use super::window::Window;

/// Most rungs of a ladder.
pub const MAX_RUNGS: usize = 8;

/// Loads that are looked at.
const LOADS: usize = 45;
/// Of these, a step back up looks only at the newest: a load that went down shall not be remembered for long.
const RECENT: usize = 20;
/// What counts as the highest load: rare spikes are above it.
const HIGH: f64 = 0.95;
const HIGH_RECENT: f64 = 0.9;
/// A high load may take this share of the budget before the rung changes; the aim of a change is lower, and that of a
/// change upwards lower still, or noise alone would drive it up and down.
const KEEP: f64 = 1.03;
const AIM_DOWN: f64 = 0.97;
const AIM_UP: f64 = 0.95;
/// The median of few loads stands for a higher percentile by this factor.
const ABOVE_MEDIAN: f64 = 1.1;
/// Frames of nothing but surplus before a step up, and at most after steps that were taken back.
const PATIENCE: u32 = 30;
const MOST_PATIENCE: u32 = 960;
/// A step up that is taken back within so many times the patience was one too many.
const REGRET: u32 = 2;
/// Frames at a rung before its cost is learnt, and how far it then moves.
const LEARN_FROM: usize = 8;
const LEARN_LEAST: usize = 3;
const LEARN_SHARE: f64 = 0.3;
/// No cost strays farther from what it was given as than this factor, either way.
const LEARN_MOST: f64 = 3.0;
/// After such a pause nothing is as it was: clocks and caches have gone to sleep.
const IDLE_NS: u64 = 2_000_000_000;

/// What a frame took.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// The rung that it was made at.
    pub rung: usize,
    /// How long that took; 0 is no measurement.
    pub took_ns: u64,
    /// When it was done.
    pub at_ns: u64,
}

/// Picks the rung of a ladder by what frames took. Memory is fixed.
#[derive(Clone, Debug)]
pub struct Governor {
    costs: [f64; MAX_RUNGS],
    given: [f64; MAX_RUNGS],
    rungs: usize,
    rung: usize,
    /// Time over cost, in nanoseconds, of the last frames, whatever their rung.
    loads: Window<LOADS>,
    /// The same of the last frames at this rung alone.
    rung_loads: Window<LEARN_FROM>,
    /// The load at the rung before, until it has been learnt from.
    came_from: Option<f64>,
    last_ns: u64,
    /// Frames of nothing but surplus so far, and the finest rung that all of them would have allowed.
    surplus: u32,
    surplus_rung: usize,
    patience: u32,
    /// Frames since the rung changed, and whether that was upwards.
    frames_at_rung: u32,
    went_up: bool,
}

impl Governor {
    /// A governor of a ladder with these relative costs, the cheapest first, that begins at rung `start`.
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
            given: costs,
            rungs: ladder.len(),
            rung: start,
            loads: Window::default(),
            rung_loads: Window::default(),
            came_from: None,
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

    /// Takes in what a frame took, and settles the rung for the next one: the finest that stays within `budget_ns`.
    /// Samples may come late; those of another rung than the present one tell the load, and decide nothing.
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
            // The step up has held.
            (self.patience, self.went_up) = (PATIENCE, false);
        }
        let budget_ns = budget_ns as f64;
        let now = ABOVE_MEDIAN * self.loads.median(5);
        let high_load = self.high(LOADS, HIGH).max(now);
        // A rung is not judged by a frame or two of its own.
        if self.rung_loads.len() >= LEARN_LEAST && high_load * self.costs[self.rung] > KEEP * budget_ns {
            let to = self.finest(high_load, AIM_DOWN * budget_ns);
            if to < self.rung {
                return self.change(to);
            }
        }
        let to = self.finest(self.high(RECENT, HIGH_RECENT).max(now), AIM_UP * budget_ns);
        if to <= self.rung {
            self.surplus = 0;
            return;
        }
        self.surplus_rung = if self.surplus == 0 { to } else { self.surplus_rung.min(to) };
        self.surplus += 1;
        if self.surplus >= self.patience {
            self.change(self.surplus_rung);
        }
    }

    /// The highest load of the last `count` frames but rare ones. Of few frames each is rare: the first ones are cold.
    fn high(&self, count: usize, p: f64) -> f64 {
        if self.loads.len() < RECENT { 0.0 } else { self.loads.percentile(count, p) }
    }

    /// The finest rung that takes no longer than `limit_ns` at this load; the cheapest if none does.
    fn finest(&self, load: f64, limit_ns: f64) -> usize {
        self.costs().iter().rposition(|cost| cost * load <= limit_ns).unwrap_or(0)
    }

    fn change(&mut self, to: usize) {
        self.learn();
        if to < self.rung && self.went_up && self.frames_at_rung < REGRET * self.patience {
            self.patience = (2 * self.patience).min(MOST_PATIENCE);
        }
        self.came_from = (!self.rung_loads.is_empty()).then(|| self.rung_loads.median(5));
        self.went_up = to > self.rung;
        (self.rung, self.frames_at_rung, self.surplus) = (to, 0, 0);
        self.rung_loads.clear();
    }

    /// The load before and after a change should be the same: what is not, is the cost's fault, at least in part.
    fn learn(&mut self) {
        if self.rung_loads.len() < LEARN_LEAST {
            return;
        }
        let Some(before) = self.came_from.take() else { return };
        let (rung, ratio) = (self.rung, self.rung_loads.median(LEARN_FROM) / before);
        let (least, most) = (self.given[rung] / LEARN_MOST, self.given[rung] * LEARN_MOST);
        // The ladder stays one: a rung is no cheaper than those below it.
        let below = if rung > 0 { self.costs[rung - 1] } else { 0.0 };
        let above = if rung + 1 < self.rungs { self.costs[rung + 1] } else { f64::INFINITY };
        self.costs[rung] = (self.costs[rung] * ratio.powf(LEARN_SHARE)).clamp(least.max(below), most.min(above));
    }

    /// Keeps the rung and the costs, and forgets what the load was.
    fn forget(&mut self) {
        self.loads.clear();
        self.rung_loads.clear();
        self.came_from = None;
        (self.surplus, self.frames_at_rung, self.went_up, self.patience) = (0, 0, false, PATIENCE);
    }
}

#[cfg(test)]
mod tests;
