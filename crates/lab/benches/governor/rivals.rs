//! Rules that pick the quality level: the governor, its rivals, and an oracle.

use bokehcam::budget::{Governor, Sample, Window};

/// A frame's time at the cheapest level is the load; this number of nanoseconds is one unit of it.
const UNIT_NS: f64 = 1e6;
const PERIOD_NS: u64 = 33_333_333;

/// A rule that picks quality levels.
pub trait LevelRule {
    /// Notes that a frame at `level` took `took`; frame `now` comes next.
    fn record(&mut self, level: usize, took: f64, now: usize);
    /// Returns the level of the next frame; `load` is its true load, for the oracle alone.
    fn choose_level(&mut self, load: f64) -> usize;
}

/// The project's own governor.
pub struct GovernorRule {
    governor: Governor<1>,
    budget_ns: u64,
}

impl GovernorRule {
    /// Creates it with assumed costs, which may differ from the true ones.
    pub fn new(costs: &[f64], budget: f64) -> Self {
        Self { governor: Governor::new(costs, costs.len() / 2), budget_ns: (budget * UNIT_NS) as u64 }
    }
}

impl LevelRule for GovernorRule {
    fn record(&mut self, level: usize, took: f64, now: usize) {
        let at_ns = now as u64 * PERIOD_NS;
        self.governor.record(Sample { level, took_ns: (took * UNIT_NS) as u64, at_ns }, self.budget_ns);
    }
    fn choose_level(&mut self, _: f64) -> usize {
        self.governor.level()
    }
}

/// One level down above the budget, one up below three quarters of it.
pub struct ThresholdRule {
    level: usize,
    levels: usize,
    budget: f64,
}

impl ThresholdRule {
    /// Begins at the middle level.
    pub fn new(levels: usize, budget: f64) -> Self {
        Self { level: levels / 2, levels, budget }
    }
}

impl LevelRule for ThresholdRule {
    fn record(&mut self, _: usize, took: f64, _: usize) {
        if took > self.budget {
            self.level = self.level.saturating_sub(1);
        } else if took < 0.75 * self.budget {
            self.level = (self.level + 1).min(self.levels - 1);
        }
    }
    fn choose_level(&mut self, _: f64) -> usize {
        self.level
    }
}

/// The controller of Filament's dynamic resolution, with its gains: a scale follows the error of the median of nine
/// frames against the budget less a headroom, and the level is the finest that costs no more than the scale.
pub struct PidRule {
    costs: Vec<f64>,
    target: f64,
    recent: Window<9>,
    scale: f64,
    integral: f64,
    last_error: f64,
}

impl PidRule {
    const P: f64 = 0.118;
    const I: f64 = 0.002;
    const D: f64 = 0.0;
    const INTEGRAL: f64 = 100.0;
    /// Dead band of the error: a little too slow, somewhat too fast.
    const BAND: (f64, f64) = (-0.01, 0.05);

    /// Creates it with the fraction `headroom` of the budget kept free.
    pub fn new(costs: &[f64], budget: f64, headroom: f64) -> Self {
        let scale = costs[costs.len() / 2];
        let target = budget * (1.0 - headroom);
        Self { costs: costs.to_vec(), target, recent: Window::default(), scale, integral: 0.0, last_error: 0.0 }
    }
}

impl LevelRule for PidRule {
    fn record(&mut self, _: usize, took: f64, _: usize) {
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
    fn choose_level(&mut self, _: f64) -> usize {
        self.costs.iter().rposition(|&cost| cost <= self.scale * 1.000_001).unwrap_or(0)
    }
}

/// Knows the time of each frame in advance, noise included: the upper bound for any rule.
pub struct OracleRule {
    /// The true costs.
    pub costs: Vec<f64>,
    /// The budget.
    pub budget: f64,
}

impl LevelRule for OracleRule {
    fn record(&mut self, _: usize, _: f64, _: usize) {}
    fn choose_level(&mut self, load: f64) -> usize {
        self.costs.iter().rposition(|&cost| cost * load <= self.budget).unwrap_or(0)
    }
}
