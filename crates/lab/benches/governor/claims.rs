//! The machines that the governor is measured on, and the claims about it there.

use super::load::{DEFAULT_PROFILE, LoadProfile, Rng};
use super::play::{Score, simulate};
use super::rivals::{GovernorRule, LevelRule, PidRule};

/// Time budget of a frame, in units of the load.
pub const BUDGET: f64 = 5.0;
/// Maximum fraction of the frames over the budget.
const MAX_MISSES: f64 = 0.015;
/// Maximum number of quality level changes a minute.
const MAX_SWITCHES: f64 = 6.0;

/// A machine, how well its costs are known, and the number of frames within which a step of the load is settled.
#[derive(Clone, Copy)]
pub struct Case {
    /// Name in the tables.
    pub name: &'static str,
    levels: usize,
    profile: LoadProfile,
    cost_error: f64,
    /// Limit for the 95th percentile of the rises, in frames.
    rise_frames: usize,
    /// Limit for the median of the falls, in frames: an upward change waits for 30 good frames on purpose, and longer
    /// after a revoked one.
    fall_frames: usize,
}

/// All machines.
pub fn cases() -> [Case; 5] {
    let plain = Case {
        name: "7 rungs, costs known",
        levels: 7,
        profile: DEFAULT_PROFILE,
        cost_error: 1.0,
        rise_frames: 15,
        fall_frames: 60,
    };
    let sudden = LoadProfile { step_frames: 300, ..DEFAULT_PROFILE };
    let rough = LoadProfile { noise: 0.15, spikes: (0.01, 5.0), ..DEFAULT_PROFILE };
    [
        plain,
        Case { name: "5 rungs, costs known", levels: 5, ..plain },
        Case { name: "7 rungs, costs off by up to 1.4", cost_error: 1.4, ..plain },
        Case { name: "5 rungs, a step every 10 s", levels: 5, profile: sudden, ..plain },
        Case { name: "7 rungs, noise of 15 %, spikes of 5 times", profile: rough, rise_frames: 130, ..plain },
    ]
}

/// The governor's score, and the quality of the PID controller at an equal rate of misses; `None` where the PID never
/// misses as rarely.
pub struct Outcome {
    /// The governor's score.
    pub ours: Score,
    /// The PID's scores, each with its headroom.
    pub pids: Vec<(f64, Score)>,
    /// The PID's quality at the governor's rate of misses.
    pub equal: Option<f64>,
}

impl Case {
    /// Returns the true costs of its quality levels: 1 to 8, in equal ratios.
    pub fn costs(&self) -> Vec<f64> {
        (0..self.levels).map(|level| 8f64.powf(level as f64 / (self.levels - 1) as f64)).collect()
    }

    /// Plays each seed for `minutes` by a rule, which is created from the costs as they are known.
    pub fn simulate(
        &self,
        seeds: std::ops::RangeInclusive<u64>,
        minutes: u32,
        make: impl Fn(&[f64]) -> Box<dyn LevelRule>,
    ) -> Score {
        let (mut score, costs) = (Score::default(), self.costs());
        for seed in seeds {
            let known = perturb_costs(&costs, self.cost_error, seed);
            simulate(&mut *make(&known), &costs, BUDGET, &self.profile, minutes as usize * 1800, seed, &mut score);
        }
        score
    }

    /// Plays the governor and the PID controller.
    pub fn compare_with_pid(&self, seeds: std::ops::RangeInclusive<u64>, minutes: u32) -> Outcome {
        let ours = self.simulate(seeds.clone(), minutes, |known| Box::new(GovernorRule::new(known, BUDGET)));
        let pid =
            |room: f64| self.simulate(seeds.clone(), minutes, move |known| Box::new(PidRule::new(known, BUDGET, room)));
        let pids: Vec<(f64, Score)> = (1..=12).map(|k| f64::from(k) * 0.05).map(|room| (room, pid(room))).collect();
        let equal = quality_at_equal_misses(&pids, ours.miss_fraction());
        Outcome { ours, pids, equal }
    }

    /// Returns the claims that an outcome breaks.
    pub fn find_violations(&self, Outcome { ours, equal, .. }: &Outcome) -> Vec<String> {
        let settled = [("rise", false, 0.95, self.rise_frames), ("fall", true, 0.5, self.fall_frames)];
        let claims = [
            (ours.miss_fraction() <= MAX_MISSES, format!("{:.2} % misses", 100.0 * ours.miss_fraction())),
            (
                ours.switches_per_minute() <= MAX_SWITCHES,
                format!("{:.1} switches a minute", ours.switches_per_minute()),
            ),
            (
                equal.is_none_or(|equal| ours.mean_quality() > equal),
                format!("quality {:.4}, the PID {equal:?}", ours.mean_quality()),
            ),
        ];
        let settled = settled.map(|(step, fell, quantile, most)| {
            let frames = ours.settling_frames(fell, quantile);
            (frames <= most, format!("{frames} frames to settle after a {step}"))
        });
        claims.into_iter().chain(settled).filter(|claim| !claim.0).map(|claim| claim.1).collect()
    }
}

/// Returns the costs with all but the first off by a factor of up to `most`, either way, and still ascending.
fn perturb_costs(costs: &[f64], most: f64, seed: u64) -> Vec<f64> {
    let mut rng = Rng::new(seed ^ 0x5eed);
    let mut wrong: Vec<f64> = costs.iter().map(|cost| cost * most.powf(2.0 * rng.uniform() - 1.0)).collect();
    for k in 1..wrong.len() {
        wrong[k] = wrong[k].max(wrong[k - 1] * 1.01);
    }
    wrong
}

/// Returns the PID's quality at this fraction of misses, interpolated between the two nearest headrooms.
fn quality_at_equal_misses(pids: &[(f64, Score)], misses: f64) -> Option<f64> {
    pids.windows(2).find_map(|pair| {
        let [(a, qa), (b, qb)] = [0, 1].map(|k| (pair[k].1.miss_fraction(), pair[k].1.mean_quality()));
        (b <= misses && misses <= a).then(|| qb + (qa - qb) * if a > b { (misses - b) / (a - b) } else { 0.0 })
    })
}
