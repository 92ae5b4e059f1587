//! The governor, a controller with hysteresis: picks the finest plan for a frame that fits the time budget.
//!
//! A plan has a quality level (level) for each stage. A stage's time is modelled as `load * cost(level)`: the current
//! load times the level's relative cost. Loads of frames of different levels are therefore comparable, and the time of
//! any level can be predicted before it is tried. A step down is immediate; a step up needs a run of frames with time
//! to spare, and a longer run after each step up that was soon reverted. The costs are learnt: if the load seems to
//! change whenever the level changes, the cost is wrong.

use super::load::{LoadModel, MIN_LEARN_FRAMES, Sample, SampleKind};

/// Fractions of the time budget: the plan is kept up to `KEEP_FRACTION`; a step down must fit `STEP_DOWN_FRACTION`, a
/// step up `STEP_UP_FRACTION`. Without this hysteresis, noise alone would change the plan back and forth.
const KEEP_FRACTION: f64 = 1.03;
const STEP_DOWN_FRACTION: f64 = 0.97;
const STEP_UP_FRACTION: f64 = 0.95;
/// Consecutive frames with time to spare before a step up: initially, and at most after reverted steps.
const PATIENCE: u32 = 30;
const MAX_PATIENCE: u32 = 960;
/// A step up that is reverted within this many times the patience doubles the patience.
const REVERT_FACTOR: u32 = 2;

/// Picks a plan by the times of the last frames.
#[derive(Clone, Debug)]
pub struct Governor<const STAGES: usize> {
    stages: [LoadModel; STAGES],
    /// Quality level of each stage, cheapest plan first.
    plans: Vec<[usize; STAGES]>,
    plan: usize,
    /// Consecutive frames with time to spare, and the finest plan that fits all of them.
    surplus: u32,
    surplus_plan: usize,
    /// The `surplus` that a step up needs.
    patience: u32,
    /// Frames since the plan changed, and whether that was upwards.
    frames_at_plan: u32,
    went_up: bool,
}

/// Predicted times of the stages, in nanoseconds, divided by a fraction of the budget, so that they compare to the
/// whole.
#[derive(Clone, Copy, Debug)]
pub struct PredictedTimes<const STAGES: usize> {
    /// Times that nearly all frames stay below.
    pub high_ns: [f64; STAGES],
    /// Times slightly above the median.
    pub usual_ns: [f64; STAGES],
    /// Fraction of the budget by which the times are divided.
    pub fraction: f64,
}

impl Governor<1> {
    /// Creates a governor of one ladder with these relative costs, cheapest first, that starts at level `start`.
    ///
    /// # Panics
    /// There is no level, there are more than [`super::MAX_LEVELS`], or the costs are not positive and ascending.
    pub fn new(ladder: &[f64], start: usize) -> Self {
        Self::with_stages([ladder], (0..ladder.len()).map(|level| [level]).collect(), start)
    }

    /// Returns the quality level for the next frame.
    pub fn level(&self) -> usize {
        self.plan
    }

    /// Returns the learnt relative costs, cheapest first.
    pub fn costs(&self) -> &[f64] {
        self.stages[0].costs()
    }

    /// Returns the expected time of the next frame, in nanoseconds; `None` before the first sample.
    pub fn expected_ns(&self) -> Option<u64> {
        self.expected_stage_ns(0)
    }

    /// Adds one frame's time and chooses the level for the next frame: the finest that fits `budget_ns`. Samples may be
    /// late: one of another level than the present one only adds to the loads.
    pub fn record(&mut self, sample: Sample, budget_ns: u64) {
        if self.add_sample(0, sample) {
            self.choose_plan(|_, times| times.high_ns[0] <= budget_ns as f64);
        }
    }
}

impl<const STAGES: usize> Governor<STAGES> {
    /// Creates a governor of several ladders that starts with plan `start`. Each of the `plans` has a level for every
    /// stage; the cheapest comes first and is allowed at any load.
    ///
    /// # Panics
    /// A ladder has no level or more than [`super::MAX_LEVELS`], or its costs are not positive and ascending; there is
    /// no plan.
    pub fn with_stages(ladders: [&[f64]; STAGES], plans: Vec<[usize; STAGES]>, start: usize) -> Self {
        let levels = plans[start];
        let stages = std::array::from_fn(|stage| LoadModel::new(ladders[stage], levels[stage]));
        Self {
            stages,
            plans,
            plan: start,
            surplus: 0,
            surplus_plan: start,
            patience: PATIENCE,
            frames_at_plan: 0,
            went_up: false,
        }
    }

    /// Returns the index of the plan for the next frame.
    pub fn plan(&self) -> usize {
        self.plan
    }

    /// Returns the expected time of a stage for the next frame, in nanoseconds; `None` before its first sample.
    pub fn expected_stage_ns(&self, stage: usize) -> Option<u64> {
        self.stages[stage].expected_ns()
    }

    /// Copies what another governor has learnt of a stage, and switches it to the level of the present plan.
    pub fn copy_model(&mut self, stage: usize, other: &Self) {
        self.stages[stage] = other.stages[stage];
        self.stages[stage].switch_to(self.plans[self.plan][stage]);
    }

    /// Adds the time of a stage for a frame. Returns whether it is of the stage's present level.
    pub fn add_sample(&mut self, stage: usize, sample: Sample) -> bool {
        let was_idle = self.stages[stage].was_idle(sample.at_ns);
        let noted = self.stages[stage].record(sample);
        if was_idle && noted != SampleKind::Invalid {
            (self.surplus, self.frames_at_plan, self.went_up, self.patience) = (0, 0, false, PATIENCE);
        }
        noted == SampleKind::PresentLevel
    }

    /// Chooses the plan for the next frame: the finest for which `fits` is true at the predicted times of the stages.
    pub fn choose_plan(&mut self, fits: impl Fn(usize, PredictedTimes<STAGES>) -> bool) {
        self.frames_at_plan = self.frames_at_plan.saturating_add(1);
        if self.went_up && self.frames_at_plan >= REVERT_FACTOR * self.patience {
            // The step up has held: the next one needs only the initial patience.
            (self.patience, self.went_up) = (PATIENCE, false);
        }
        let highs = self.stages.each_ref().map(LoadModel::high_and_usual);
        let fits = |plan: usize, newest: usize, fraction: f64| {
            let cost = |stage: usize| self.stages[stage].costs()[self.plans[plan][stage]] / fraction;
            let high_ns = std::array::from_fn(|stage| highs[stage].0[newest] * cost(stage));
            let usual_ns = std::array::from_fn(|stage| highs[stage].1 * cost(stage));
            fits(plan, PredictedTimes { high_ns, usual_ns, fraction })
        };
        // One or two frames of a plan prove nothing.
        if self.frames_at_plan >= MIN_LEARN_FRAMES as u32 && self.plan > 0 && !fits(self.plan, 0, KEEP_FRACTION) {
            let to = (0..self.plan).rev().find(|&plan| fits(plan, 0, STEP_DOWN_FRACTION)).unwrap_or(0);
            return self.switch_to(to);
        }
        let finest = (self.plan + 1..self.plans.len()).rev().find(|&plan| fits(plan, 1, STEP_UP_FRACTION));
        let Some(to) = finest else {
            self.surplus = 0;
            return;
        };
        self.surplus_plan = if self.surplus == 0 { to } else { self.surplus_plan.min(to) };
        self.surplus += 1;
        if self.surplus >= self.patience {
            // The finest plan that fits all frames of the run may not fit now.
            let to = if fits(self.surplus_plan, 1, STEP_UP_FRACTION) { self.surplus_plan } else { to };
            self.switch_to(to);
        }
    }

    /// Changes to the plan `to`. A step down soon after a step up doubles the patience.
    fn switch_to(&mut self, to: usize) {
        if to < self.plan && self.went_up && self.frames_at_plan < REVERT_FACTOR * self.patience {
            self.patience = (2 * self.patience).min(MAX_PATIENCE);
        }
        for (stage, load) in self.stages.iter_mut().enumerate() {
            if self.plans[to][stage] != self.plans[self.plan][stage] {
                load.switch_to(self.plans[to][stage]);
            }
        }
        self.went_up = to > self.plan;
        (self.plan, self.frames_at_plan, self.surplus) = (to, 0, 0);
    }
}

#[cfg(test)]
mod tests;
