//! What picks the rung: the governor, the rules it is measured against, and one that sees the future.

use bokehcam::budget::{Governor, Sample, Window};

/// One frame's time at the cheapest rung is the load; this many nanoseconds of it are one unit.
const UNIT_NS: f64 = 1e6;
const PERIOD_NS: u64 = 33_333_333;

/// Picks rungs.
pub trait Picker {
    /// A frame made at `rung` took `took`; frame `now` comes next.
    fn note(&mut self, rung: usize, took: f64, now: usize);
    /// The rung of the next frame, which would take `load` times a rung's cost: for those that see the future.
    fn rung(&mut self, load: f64) -> usize;
}

/// The project's own.
pub struct Ours {
    governor: Governor<1>,
    budget_ns: u64,
}

impl Ours {
    /// With these costs in mind, whatever they really are.
    pub fn new(costs: &[f64], budget: f64) -> Self {
        Self { governor: Governor::new(costs, costs.len() / 2), budget_ns: (budget * UNIT_NS) as u64 }
    }
}

impl Picker for Ours {
    fn note(&mut self, rung: usize, took: f64, now: usize) {
        let at_ns = now as u64 * PERIOD_NS;
        self.governor.note(Sample { level: rung, took_ns: (took * UNIT_NS) as u64, at_ns }, self.budget_ns);
    }
    fn rung(&mut self, _: f64) -> usize {
        self.governor.level()
    }
}

/// One rung down above the budget, one up below three quarters of it.
pub struct Threshold {
    rung: usize,
    rungs: usize,
    budget: f64,
}

impl Threshold {
    /// Begins in the middle.
    pub fn new(rungs: usize, budget: f64) -> Self {
        Self { rung: rungs / 2, rungs, budget }
    }
}

impl Picker for Threshold {
    fn note(&mut self, _: usize, took: f64, _: usize) {
        if took > self.budget {
            self.rung = self.rung.saturating_sub(1);
        } else if took < 0.75 * self.budget {
            self.rung = (self.rung + 1).min(self.rungs - 1);
        }
    }
    fn rung(&mut self, _: f64) -> usize {
        self.rung
    }
}

/// The controller of Filament's dynamic resolution, with its gains: a scale follows the error of the median of nine
/// frames against the budget less a headroom, and the rung is the finest that costs no more than the scale.
pub struct Pid {
    costs: Vec<f64>,
    target: f64,
    recent: Window<9>,
    scale: f64,
    integral: f64,
    last_error: f64,
}

impl Pid {
    const P: f64 = 0.118;
    const I: f64 = 0.002;
    const D: f64 = 0.0;
    const INTEGRAL: f64 = 100.0;
    /// Errors in this band do nothing: a little too slow, somewhat too fast.
    const BAND: (f64, f64) = (-0.01, 0.05);

    /// With this share of the budget kept free.
    pub fn new(costs: &[f64], budget: f64, headroom: f64) -> Self {
        let scale = costs[costs.len() / 2];
        let target = budget * (1.0 - headroom);
        Self { costs: costs.to_vec(), target, recent: Window::default(), scale, integral: 0.0, last_error: 0.0 }
    }
}

impl Picker for Pid {
    fn note(&mut self, _: usize, took: f64, _: usize) {
        self.recent.push(took);
        let error = (self.target - self.recent.median(9)) / self.target;
        let error = if (Self::BAND.0..Self::BAND.1).contains(&error) { 0.0 } else { error };
        let (least, most) = (self.costs[0], self.costs[self.costs.len() - 1]);
        let stuck = (self.scale <= least && error < 0.0) || (self.scale >= most && error > 0.0);
        if !stuck {
            self.integral = (self.integral + error).clamp(-Self::INTEGRAL, Self::INTEGRAL);
        }
        let out = Self::P * error + Self::I * self.integral + Self::D * (error - self.last_error);
        self.last_error = error;
        self.scale = (self.scale * (1.0 + out)).clamp(least, most);
    }
    fn rung(&mut self, _: f64) -> usize {
        self.costs.iter().rposition(|&cost| cost <= self.scale * 1.000_001).unwrap_or(0)
    }
}

/// Knows what each frame will take, noise and all: no rule can do better.
pub struct Oracle {
    /// The true costs.
    pub costs: Vec<f64>,
    /// The budget.
    pub budget: f64,
}

impl Picker for Oracle {
    fn note(&mut self, _: usize, _: f64, _: usize) {}
    fn rung(&mut self, load: f64) -> usize {
        self.costs.iter().rposition(|&cost| cost * load <= self.budget).unwrap_or(0)
    }
}
