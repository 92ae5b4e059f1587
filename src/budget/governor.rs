//! The governor, a controller with hysteresis: of the plans for a frame it picks the finest that there is time for.
//!
//! A plan has a rung for each stage. A stage's time is modelled as `load * cost(rung)`: the current load times the rung's
//! relative cost. Loads of frames of different rungs are therefore comparable, and the time of any rung can be predicted
//! before it is tried. A step down is immediate; a step up needs a run of frames with time to spare, and a longer run after
//! each step up that had to be undone soon. The costs are learnt: if the load seems to jump whenever the rung changes, the
//! cost is wrong.

use super::load::{LEARN_LEAST, Load, Noted, Sample};

/// Shares of the time: the plan is kept up to the first; a step down must fit the second, a step up the third.
/// Without these gaps, noise alone would drive the plan up and down.
const KEEP: f64 = 1.03;
const AIM_DOWN: f64 = 0.97;
const AIM_UP: f64 = 0.95;
/// Consecutive frames with time to spare before a step up: at first, and at most after steps up that were undone.
const PATIENCE: u32 = 30;
const MOST_PATIENCE: u32 = 960;
/// A step up that is undone within this many times the patience doubles the patience.
const REGRET: u32 = 2;

/// Picks a plan by the times of the last frames.
#[derive(Clone, Debug)]
pub struct Governor<const STAGES: usize> {
    stages: [Load; STAGES],
    /// The rung of each stage, the cheapest plan first.
    plans: Vec<[usize; STAGES]>,
    plan: usize,
    /// Consecutive frames with time to spare, and the finest plan that all of them would have allowed.
    surplus: u32,
    surplus_plan: usize,
    /// The `surplus` that a step up needs.
    patience: u32,
    /// Frames since the plan changed, and whether that was upwards.
    frames_at_plan: u32,
    went_up: bool,
}

/// How long stages take, in nanoseconds, over a share of the time there is: with that as a whole they are compared.
#[derive(Clone, Copy, Debug)]
pub struct Times<const STAGES: usize> {
    /// What nearly all frames stay below.
    pub high_ns: [f64; STAGES],
    /// A little more than the median.
    pub usual_ns: [f64; STAGES],
    /// The share.
    pub share: f64,
}

impl Governor<1> {
    /// A governor of one ladder with these relative costs, the cheapest first, that starts at rung `start`.
    ///
    /// # Panics
    /// There is no rung, there are more than [`super::MAX_RUNGS`], or the costs are not positive and ascending.
    pub fn new(ladder: &[f64], start: usize) -> Self {
        Self::of_stages([ladder], (0..ladder.len()).map(|rung| [rung]).collect(), start)
    }

    /// The rung for the next frame.
    pub fn rung(&self) -> usize {
        self.plan
    }

    /// The relative costs as learnt, the cheapest first.
    pub fn costs(&self) -> &[f64] {
        self.stages[0].costs()
    }

    /// How long the next frame is likely to take, in nanoseconds; `None` before the first sample.
    pub fn expected_ns(&self) -> Option<u64> {
        self.expected_ns_of(0)
    }

    /// Takes in one frame's time and chooses the rung for the next frame: the finest that stays within `budget_ns`.
    /// Samples may come late: one of another rung than the present one only adds to the loads.
    pub fn note(&mut self, sample: Sample, budget_ns: u64) {
        if self.learn_from(0, sample) {
            self.choose(|_, times| times.high_ns[0] <= budget_ns as f64);
        }
    }
}

impl<const STAGES: usize> Governor<STAGES> {
    /// A governor of several ladders. Of the `plans`, each a rung for every stage, the cheapest comes first, and may always be
    /// taken; it starts with plan `start`.
    ///
    /// # Panics
    /// A ladder has no rung or more than [`super::MAX_RUNGS`], or its costs are not positive and ascending; there is no plan.
    pub fn of_stages(ladders: [&[f64]; STAGES], plans: Vec<[usize; STAGES]>, start: usize) -> Self {
        let rungs = plans[start];
        let stages = std::array::from_fn(|stage| Load::new(ladders[stage], rungs[stage]));
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

    /// The plan for the next frame.
    pub fn plan(&self) -> usize {
        self.plan
    }

    /// How long a stage is likely to take for the next frame, in nanoseconds; `None` before its first sample.
    pub fn expected_ns_of(&self, stage: usize) -> Option<u64> {
        self.stages[stage].expected_ns()
    }

    /// Takes over what another governor has learnt of a stage, at the rung of the present plan.
    pub fn learn_as(&mut self, stage: usize, other: &Self) {
        self.stages[stage] = other.stages[stage];
        self.stages[stage].switch_to(self.plans[self.plan][stage]);
    }

    /// Takes in the time that a stage took for a frame; whether it is of the stage's present rung.
    pub fn learn_from(&mut self, stage: usize, sample: Sample) -> bool {
        let was_idle = self.stages[stage].was_idle(sample.at_ns);
        let noted = self.stages[stage].note(sample);
        if was_idle && noted != Noted::Nothing {
            (self.surplus, self.frames_at_plan, self.went_up, self.patience) = (0, 0, false, PATIENCE);
        }
        noted == Noted::Own
    }

    /// Chooses the plan for the next frame: the finest that `fits` with these times of the stages.
    pub fn choose(&mut self, fits: impl Fn(usize, Times<STAGES>) -> bool) {
        self.frames_at_plan = self.frames_at_plan.saturating_add(1);
        if self.went_up && self.frames_at_plan >= REGRET * self.patience {
            // The step up has held: the next one needs no more than the usual patience.
            (self.patience, self.went_up) = (PATIENCE, false);
        }
        let highs = self.stages.each_ref().map(Load::high);
        let fits = |plan: usize, newest: usize, share: f64| {
            let cost = |stage: usize| self.stages[stage].costs()[self.plans[plan][stage]] / share;
            let high_ns = std::array::from_fn(|stage| highs[stage].0[newest] * cost(stage));
            let usual_ns = std::array::from_fn(|stage| highs[stage].1 * cost(stage));
            fits(plan, Times { high_ns, usual_ns, share })
        };
        // One or two frames of a plan prove nothing.
        if self.frames_at_plan >= LEARN_LEAST as u32 && self.plan > 0 && !fits(self.plan, 0, KEEP) {
            let to = (0..self.plan).rev().find(|&plan| fits(plan, 0, AIM_DOWN)).unwrap_or(0);
            return self.switch_to(to);
        }
        let finest = (self.plan + 1..self.plans.len()).rev().find(|&plan| fits(plan, 1, AIM_UP));
        let Some(to) = finest else {
            self.surplus = 0;
            return;
        };
        self.surplus_plan = if self.surplus == 0 { to } else { self.surplus_plan.min(to) };
        self.surplus += 1;
        if self.surplus >= self.patience {
            // What all frames would have allowed is not always what each did.
            let to = if fits(self.surplus_plan, 1, AIM_UP) { self.surplus_plan } else { to };
            self.switch_to(to);
        }
    }

    /// Changes to the plan `to`. A step down soon after a step up doubles the patience.
    fn switch_to(&mut self, to: usize) {
        if to < self.plan && self.went_up && self.frames_at_plan < REGRET * self.patience {
            self.patience = (2 * self.patience).min(MOST_PATIENCE);
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
