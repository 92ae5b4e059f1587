//! The planner: chooses depth effort, depth sharing and blur quality of a frame together, within its time budget.

use super::governor::{Governor, PredictedTimes};
use super::load::Sample;
use super::window::Window;

/// The stages of a plan.
const DEPTH_STAGE: usize = 0;
const BLUR_STAGE: usize = 1;
/// Largest number of frames that share a depth map.
const MAX_FRAMES_PER_MAP: usize = 3;
/// Penalties of a plan relative to the finest one; the fitting plan with the lowest sum is taken. With less time, first
/// depth gets less effort, then the blur drops a level, then frames share depth if allowed; if not, there are fewer
/// frames, and the blur drops first as far as that saves noticeable time.
const EFFORT_PENALTY: f64 = 2.0;
const SHARING_PENALTIES: [f64; MAX_FRAMES_PER_MAP] = [0.0, 6.0, 10.0];
const FINER_BLUR_PENALTY: f64 = -0.4;
const COARSER_BLUR_PENALTY: f64 = 3.0;

/// Deadline of a frame, in periods after its capture.
pub const DEADLINE_PERIODS: u64 = 2;
/// Fraction of the deadline at which the blur must be finished: the rest is for delivery and jitter.
const DEADLINE_FRACTION: f64 = 0.8;
/// Depth handles one frame at a time: its average time may take at most this fraction of the period.
const MAX_DEPTH_FRACTION: f64 = 0.9;
/// Guaranteed fractions of the blur's budget and of a frame's time for depth: below them, a late frame does not lower
/// the quality of that stage.
const MIN_BLUR_FRACTION: f64 = 0.6;
const MIN_DEPTH_FRACTION: f64 = 0.5;
/// Frames start to share depth if a frame with reused depth takes at most the first fraction of the time of one with
/// its own depth, and continue up to the second (hysteresis): motion compensation and a new matte may cost nearly as
/// much as depth.
const MAX_REUSE_FRACTION: [f64; 2] = [0.65, 0.8];
/// If depth does not keep up, the blur is lowered only if its cheapest level saves more than this fraction of its time.
const MIN_SAVED_FRACTION: f64 = 0.05;
/// Number of frame ages in the window: three seconds at 30 fps.
const AGE_WINDOW: usize = 90;
/// Number of first frames to ignore: they are old because of one-time initialisation.
const WARM_UP_FRAMES: usize = 8;

/// How depth and blur of a frame are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plan {
    /// Number of frames that share a depth map.
    pub frames: usize,
    /// Index of the depth source's effort.
    pub effort: usize,
    /// Index of the blur's quality level.
    pub level: usize,
}

/// Timing of depth for a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DepthTimes {
    /// Effort index; `None` if the depth of an earlier frame was reused.
    pub effort: Option<usize>,
    /// Time that it took, in nanoseconds.
    pub took_ns: u64,
    /// Age of the frame at its start, in nanoseconds.
    pub age_ns: u64,
    /// Time at which it was finished, in nanoseconds.
    pub at_ns: u64,
}

/// Chooses plans with a [`Governor`] of two stages.
#[derive(Clone, Debug)]
pub struct Planner {
    governor: Governor<2>,
    /// Plans, cheapest first.
    plans: Vec<Plan>,
    efforts: Vec<f64>,
    /// Time of the cheapest blur relative to each level.
    cheapest_blur: Vec<f64>,
    budget_ns: u64,
    /// Frame period in real time; `None` otherwise.
    period_ns: Option<u64>,
    /// Ages of the last frames at the start of their own depth.
    ages: Window<AGE_WINDOW>,
    /// Times of frames that computed their own depth, and of those that reused it.
    own_depth_ns: Window<AGE_WINDOW>,
    reused_depth_ns: Window<AGE_WINDOW>,
    /// Current limit of frames that share a depth map, 1 if sharing saves nothing; and whether sharing is allowed at
    /// all.
    max_frames: usize,
    may_share: bool,
    warm_up_count: usize,
}

impl Planner {
    /// Creates a planner. The blur of a frame may take `budget_ns`. In real time, with a frame every `period_ns`,
    /// frames must also be finished within two periods of their capture; otherwise depth always gets full effort.
    /// `efforts` are the relative costs of depth, ending with the finest, 1; `may_share` allows frames to share depth.
    /// `blur_costs` are the relative costs of the blur's levels, of which `usual` is the preferred and `start` the first.
    ///
    /// # Panics
    /// The costs are empty, too many, not positive or not ascending.
    pub fn new(
        budget_ns: u64,
        period_ns: Option<u64>,
        efforts: &[f64],
        may_share: bool,
        blur_costs: &[f64],
        [usual, start]: [usize; 2],
    ) -> Self {
        let max_frames = if period_ns.is_some() && may_share { MAX_FRAMES_PER_MAP } else { 1 };
        let min_effort = if period_ns.is_some() { 0 } else { efforts.len() - 1 };
        let mut plans = Vec::new();
        for level in 0..blur_costs.len() {
            let full = efforts.len() - 1;
            plans.extend((min_effort..=full).map(|effort| Plan { frames: 1, effort, level }));
            plans.extend((2..=max_frames).map(|frames| Plan { frames, effort: 0, level }));
        }
        // Sum of the penalties; sorted so that the cheapest plan comes first.
        let penalty = |plan: &Plan| {
            let finer = plan.level as f64 - usual as f64;
            let blur = if finer < 0.0 { -COARSER_BLUR_PENALTY * finer } else { FINER_BLUR_PENALTY * finer };
            EFFORT_PENALTY * (efforts.len() - 1 - plan.effort) as f64 + SHARING_PENALTIES[plan.frames - 1] + blur
        };
        plans.sort_by(|a, b| penalty(b).total_cmp(&penalty(a)));
        let first = Plan { frames: 1, effort: efforts.len() - 1, level: start };
        Self {
            governor: create_governor(efforts, blur_costs, &plans, first),
            plans,
            efforts: efforts.to_vec(),
            cheapest_blur: blur_costs.iter().map(|cost| blur_costs[0] / cost).collect(),
            budget_ns,
            period_ns,
            ages: Window::default(),
            own_depth_ns: Window::default(),
            reused_depth_ns: Window::default(),
            max_frames,
            may_share,
            warm_up_count: 0,
        }
    }

    /// Returns a planner for a blur with other levels. Their learnt times are discarded, those of depth are kept.
    pub fn with_blur(&self, blur_costs: &[f64], [usual, start]: [usize; 2]) -> Self {
        let mut planner =
            Self::new(self.budget_ns, self.period_ns, &self.efforts, self.may_share, blur_costs, [usual, start]);
        let now = Plan { level: start, ..self.plan() };
        planner.governor = create_governor(&self.efforts, blur_costs, &planner.plans, now);
        planner.governor.copy_model(DEPTH_STAGE, &self.governor);
        let Self { ages, own_depth_ns, reused_depth_ns, max_frames, warm_up_count, .. } = *self;
        Self { ages, own_depth_ns, reused_depth_ns, max_frames, warm_up_count, ..planner }
    }

    /// Changes the time budget of the blur.
    pub fn set_budget(&mut self, budget_ns: u64) {
        self.budget_ns = budget_ns;
    }

    /// Returns the plan for the next frame.
    pub fn plan(&self) -> Plan {
        let plan = self.plans[self.governor.plan()];
        Plan { frames: plan.frames.min(self.max_frames), ..plan }
    }

    /// Returns the expected time of the next frame's blur, in nanoseconds; `None` before the first sample.
    pub fn expected_blur_ns(&self) -> Option<u64> {
        self.governor.expected_stage_ns(BLUR_STAGE)
    }

    /// Adds the timing of depth for a frame.
    pub fn record_depth(&mut self, DepthTimes { effort, took_ns, age_ns, at_ns }: DepthTimes) {
        let Some(level) = effort else { return self.reused_depth_ns.push(took_ns as f64) };
        self.warm_up_count = (self.warm_up_count + 1).min(WARM_UP_FRAMES);
        // The first one includes memory allocation.
        if self.warm_up_count > 1 {
            self.governor.add_sample(DEPTH_STAGE, Sample { level, took_ns, at_ns });
            self.own_depth_ns.push(took_ns as f64);
        }
        if self.warm_up_count == WARM_UP_FRAMES {
            self.ages.push(age_ns as f64);
        }
    }

    /// Adds the time of a frame's blur, and chooses the next frame's plan.
    pub fn record_blur(&mut self, sample: Sample) {
        if self.governor.add_sample(BLUR_STAGE, sample) {
            self.choose_plan();
        }
    }

    /// Chooses the next frame's plan after a frame that was too late to be blurred.
    pub fn record_late_frame(&mut self) {
        self.choose_plan();
    }

    /// Chooses the finest plan whose frames are predicted to keep up with the camera, and to be shown in time.
    fn choose_plan(&mut self) {
        let Self {
            governor,
            plans,
            cheapest_blur,
            budget_ns,
            period_ns,
            ages,
            own_depth_ns,
            reused_depth_ns,
            max_frames,
            may_share,
            ..
        } = self;
        let budget_ns = *budget_ns as f64;
        let Some(period_ns) = period_ns.map(|period_ns| period_ns as f64) else {
            return governor.choose_plan(|_, times| times.high_ns[BLUR_STAGE] <= budget_ns);
        };
        // A smaller blur budget also limits depth.
        let frame_ns = budget_ns.min(period_ns);
        let (old_ns, age_ns, reused_ns) =
            (ages.percentile(AGE_WINDOW, 0.95), ages.median(AGE_WINDOW), reused_depth_ns.median(AGE_WINDOW));
        let worth = MAX_REUSE_FRACTION[usize::from(*max_frames > 1)];
        *max_frames =
            if *may_share && reused_ns <= worth * own_depth_ns.median(AGE_WINDOW) { MAX_FRAMES_PER_MAP } else { 1 };
        let (max_frames, may_share) = (*max_frames, *may_share);
        let late_ns = DEADLINE_PERIODS as f64 * period_ns;
        governor.choose_plan(|plan, PredictedTimes { high_ns: [depth_ns, blur_ns], usual_ns, fraction }| {
            let Plan { frames, level, .. } = plans[plan];
            let frames = frames.min(max_frames);
            // Also true if sharing saves nothing.
            let (is_cheapest, is_shared) = (level == 0, frames > 1 || max_frames == 1);
            let saved_ns = usual_ns[BLUR_STAGE] * (1.0 - cheapest_blur[level]);
            let depth_per_frame_ns = (depth_ns + (frames - 1) as f64 * reused_ns) / frames as f64;
            let depth_keeps_up = match may_share {
                true => depth_per_frame_ns <= MAX_DEPTH_FRACTION * frame_ns || frames == max_frames,
                // Each frame has its own depth, at a lower frame rate: the blur is lowered first, if that saves
                // noticeable time.
                false => {
                    usual_ns[DEPTH_STAGE] <= MAX_DEPTH_FRACTION * frame_ns
                        || saved_ns <= fraction * MIN_SAVED_FRACTION * usual_ns[DEPTH_STAGE]
                }
            };
            let keeps_up = depth_keeps_up && (blur_ns <= budget_ns || is_cheapest);
            // Jitter of independent sources: standard deviations add in quadrature.
            let variance = (old_ns - age_ns).powi(2)
                + (depth_ns - usual_ns[DEPTH_STAGE]).powi(2)
                + (blur_ns - usual_ns[BLUR_STAGE]).powi(2);
            let ready_ns = age_ns + usual_ns[DEPTH_STAGE] + usual_ns[BLUR_STAGE] + variance.sqrt();
            // The frame would be dropped now, and not with a cheaper blur at the same jitter.
            let soonest_ns = age_ns + fraction * (ready_ns - saved_ns - age_ns);
            let is_lost = ready_ns > late_ns && soonest_ns <= late_ns;
            let is_in_time = ready_ns <= DEADLINE_FRACTION * late_ns;
            let has_less = (blur_ns <= MIN_BLUR_FRACTION * budget_ns || is_cheapest)
                && (depth_ns <= MIN_DEPTH_FRACTION * frame_ns || is_shared);
            keeps_up && !is_lost && (is_in_time || has_less)
        });
    }
}

/// Creates a governor that starts with a plan.
fn create_governor(efforts: &[f64], blur_costs: &[f64], plans: &[Plan], start: Plan) -> Governor<2> {
    let stages = plans.iter().map(|plan| [plan.effort, plan.level]).collect();
    Governor::with_stages([efforts, blur_costs], stages, plans.iter().position(|&plan| plan == start).unwrap_or(0))
}

#[cfg(test)]
mod tests;
