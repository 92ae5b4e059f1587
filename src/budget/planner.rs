//! What a frame gets in the time there is: one choice for its depth and its blur.

use super::governor::{Governor, Times};
use super::load::Sample;
use super::window::Window;

/// The stages of a plan.
const DEPTH: usize = 0;
const BLUR: usize = 1;
/// The most frames that share a depth map.
const MOST_FRAMES: usize = 3;
/// What a plan lacks of the finest one. First of all come depth for every frame and the usual blur. With less time depth is
/// made with less effort, then the blur is a level lower, then frames share depth, where they may: else there are fewer frames, and
/// the blur is as low as makes a difference before that. Nothing is given up where something that
/// weighs less would do, and all that there is time for is taken.
const LESS_EFFORT: f64 = 2.0;
const SHARED: [f64; MOST_FRAMES] = [0.0, 6.0, 10.0];
const FINER_BLUR: f64 = -0.4;
const COARSER_BLUR: [f64; 3] = [0.0, 3.0, 7.0];

/// Periods after capture at which a frame is to be delivered at the latest.
pub(crate) const DEADLINE_PERIODS: u64 = 2;
/// Share of that by which the blur is to be done: the rest is for the way to the sink and for bad luck.
const DEADLINE_SHARE: f64 = 0.8;
/// Depth is made of one frame at a time: it has no more than this share of the period on average.
const MOST_DEPTH: f64 = 0.9;
/// In any case the blur has this share of its budget, and depth this one of a frame's time: what makes frames old is not to be
/// saved there.
const OWN_BLUR: f64 = 0.6;
const OWN_DEPTH: f64 = 0.5;
/// Frames share depth where one that takes it over takes no more than the first share of the time of one that makes its own, and
/// then up to the second: what moves depth and finds a new matte may cost nearly as much.
const WORTH_SHARING: [f64; 2] = [0.65, 0.8];
/// The blur is lowered for depth that does not keep up where the cheapest one saves more than this share of its time.
const WORTH_SAVING: f64 = 0.05;
/// Frames whose ages are remembered: three seconds at 30 fps.
const AGES: usize = 90;
/// The first frames are old, as all that makes them is made then.
const WARMING_UP: usize = 8;

/// How depth and blur of a frame are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plan {
    /// Number of frames that share a depth map.
    pub frames: usize,
    /// The depth source's effort, as its place among those there are.
    pub effort: usize,
    /// The blur's rung.
    pub rung: usize,
}

/// What depth took for a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DepthTimes {
    /// The effort that it was made with; `None` where it was taken over from an earlier frame.
    pub effort: Option<usize>,
    /// How long that took, in nanoseconds.
    pub took_ns: u64,
    /// How old the frame was when it began, in nanoseconds.
    pub age_ns: u64,
    /// When it was done.
    pub at_ns: u64,
}

/// Picks plans.
#[derive(Clone, Debug)]
pub struct Planner {
    governor: Governor<2>,
    /// The cheapest first.
    plans: Vec<Plan>,
    efforts: Vec<f64>,
    /// What the cheapest blur takes of the time of each rung.
    least_blur: Vec<f64>,
    budget_ns: u64,
    /// Of frames that come in real time.
    period_ns: Option<u64>,
    /// Ages of the last frames when depth of their own began.
    ages: Window<AGES>,
    /// How long frames took that made their own depth, and those whose depth was taken over.
    own: Window<AGES>,
    held: Window<AGES>,
    /// The most frames of a plan that are taken at their word: one where it saves nothing to share depth; and whether it may
    /// be shared at all.
    most_frames: usize,
    shares: bool,
    begun: usize,
}

impl Planner {
    /// The blur of a frame may take `budget_ns` at most. In real time, where frames come every `period_ns`, they have to be
    /// ready two periods after their capture as well; else depth is made as well as can be. `efforts` are the costs of depth,
    /// the finest, 1, at the end, and frames may share it or not; `rungs` are the costs of the blur; of these, `usual` is what
    /// there should be, and `start` the first.
    ///
    /// # Panics
    /// Costs are none, too many, not positive or not ascending.
    pub fn new(
        (budget_ns, period_ns): (u64, Option<u64>),
        (efforts, shares): (&[f64], bool),
        rungs: &[f64],
        [usual, start]: [usize; 2],
    ) -> Self {
        let most_frames = if period_ns.is_some() && shares { MOST_FRAMES } else { 1 };
        let least_effort = if period_ns.is_some() { 0 } else { efforts.len() - 1 };
        let mut plans = Vec::new();
        for rung in 0..rungs.len() {
            let full = efforts.len() - 1;
            plans.extend((least_effort..=full).map(|effort| Plan { frames: 1, effort, rung }));
            plans.extend((2..=most_frames).map(|frames| Plan { frames, effort: 0, rung }));
        }
        let lacks = |plan: &Plan| {
            let blur = match usual.checked_sub(plan.rung) {
                Some(below) => COARSER_BLUR[below.min(COARSER_BLUR.len() - 1)],
                None => FINER_BLUR * (plan.rung - usual) as f64,
            };
            LESS_EFFORT * (efforts.len() - 1 - plan.effort) as f64 + SHARED[plan.frames - 1] + blur
        };
        plans.sort_by(|a, b| lacks(b).total_cmp(&lacks(a)));
        let first = Plan { frames: 1, effort: efforts.len() - 1, rung: start };
        Self {
            governor: governor(efforts, rungs, &plans, first),
            plans,
            efforts: efforts.to_vec(),
            least_blur: rungs.iter().map(|cost| rungs[0] / cost).collect(),
            budget_ns,
            period_ns,
            ages: Window::default(),
            own: Window::default(),
            held: Window::default(),
            most_frames,
            shares,
            begun: 0,
        }
    }

    /// The same for another blur. What was learnt of the time that its rungs take holds no more.
    pub fn with_blur(&self, rungs: &[f64], [usual, start]: [usize; 2]) -> Self {
        let mut planner =
            Self::new((self.budget_ns, self.period_ns), (&self.efforts, self.shares), rungs, [usual, start]);
        let now = Plan { rung: start, ..self.plan() };
        planner.governor = governor(&self.efforts, rungs, &planner.plans, now);
        planner.governor.learn_as(DEPTH, &self.governor);
        let Self { ages, own, held, most_frames, begun, .. } = *self;
        Self { ages, own, held, most_frames, begun, ..planner }
    }

    /// The blur of a frame may take so long from now on.
    pub fn allow(&mut self, budget_ns: u64) {
        self.budget_ns = budget_ns;
    }

    /// The plan for the next frame.
    pub fn plan(&self) -> Plan {
        let plan = self.plans[self.governor.plan()];
        Plan { frames: plan.frames.min(self.most_frames), ..plan }
    }

    /// How long the blur of the next frame is likely to take; `None` before anything is known.
    pub fn expected_blur_ns(&self) -> Option<u64> {
        self.governor.expected_ns_of(BLUR)
    }

    /// Takes in what depth took for a frame.
    pub fn note_depth(&mut self, DepthTimes { effort, took_ns, age_ns, at_ns }: DepthTimes) {
        let Some(rung) = effort else { return self.held.push(took_ns as f64) };
        self.begun = (self.begun + 1).min(WARMING_UP);
        // Memory is allocated with the first one.
        if self.begun > 1 {
            self.governor.learn_from(DEPTH, Sample { rung, took_ns, at_ns });
            self.own.push(took_ns as f64);
        }
        if self.begun == WARMING_UP {
            self.ages.push(age_ns as f64);
        }
    }

    /// Takes in what the blur of a frame took, and chooses the next frame's plan.
    pub fn note_blur(&mut self, sample: Sample) {
        if self.governor.learn_from(BLUR, sample) {
            self.choose();
        }
    }

    /// Chooses the next frame's plan after one that came too late to be blurred.
    pub fn note_late(&mut self) {
        self.choose();
    }

    fn choose(&mut self) {
        let Self { governor, plans, least_blur, budget_ns, period_ns, ages, own, held, most_frames, shares, .. } = self;
        let budget_ns = *budget_ns as f64;
        let Some(period_ns) = period_ns.map(|period_ns| period_ns as f64) else {
            return governor.choose(|_, times| times.high_ns[BLUR] <= budget_ns);
        };
        // Who gives the blur less leaves depth no more.
        let frame_ns = budget_ns.min(period_ns);
        let (old_ns, age_ns, held_ns) = (ages.percentile(AGES, 0.95), ages.median(AGES), held.median(AGES));
        let worth = WORTH_SHARING[usize::from(*most_frames > 1)];
        *most_frames = if *shares && held_ns <= worth * own.median(AGES) { MOST_FRAMES } else { 1 };
        let (most_frames, shares) = (*most_frames, *shares);
        let late_ns = DEADLINE_PERIODS as f64 * period_ns;
        governor.choose(|plan, Times { high_ns: [depth_ns, blur_ns], usual_ns, share }| {
            let Plan { frames, rung, .. } = plans[plan];
            let frames = frames.min(most_frames);
            // Or nothing is to be saved by that.
            let (is_cheapest, is_shared) = (rung == 0, frames > 1 || most_frames == 1);
            let saved_ns = usual_ns[BLUR] * (1.0 - least_blur[rung]);
            let share_ns = (depth_ns + (frames - 1) as f64 * held_ns) / frames as f64;
            let depth_keeps_up = match shares {
                true => share_ns <= MOST_DEPTH * frame_ns || frames == most_frames,
                // Each frame has its own, however many that leaves: not before the blur has left it what time makes a difference.
                false => usual_ns[DEPTH] <= MOST_DEPTH * frame_ns || saved_ns <= share * WORTH_SAVING * usual_ns[DEPTH],
            };
            let keeps_up = depth_keeps_up && (blur_ns <= budget_ns || is_cheapest);
            // Bad luck rarely comes together.
            let luck =
                (old_ns - age_ns).powi(2) + (depth_ns - usual_ns[DEPTH]).powi(2) + (blur_ns - usual_ns[BLUR]).powi(2);
            let ready_ns = age_ns + usual_ns[DEPTH] + usual_ns[BLUR] + luck.sqrt();
            // It would be dropped, and with a cheaper blur it would not, though luck were as bad.
            let soonest_ns = age_ns + share * (ready_ns - saved_ns - age_ns);
            let is_lost = ready_ns > late_ns && soonest_ns <= late_ns;
            let is_in_time = ready_ns <= DEADLINE_SHARE * late_ns;
            let has_less =
                (blur_ns <= OWN_BLUR * budget_ns || is_cheapest) && (depth_ns <= OWN_DEPTH * frame_ns || is_shared);
            keeps_up && !is_lost && (is_in_time || has_less)
        });
    }
}

/// A governor that starts with a plan.
fn governor(efforts: &[f64], rungs: &[f64], plans: &[Plan], start: Plan) -> Governor<2> {
    let stages = plans.iter().map(|plan| [plan.effort, plan.rung]).collect();
    Governor::of_stages([efforts, rungs], stages, plans.iter().position(|&plan| plan == start).unwrap_or(0))
}

#[cfg(test)]
mod tests;
