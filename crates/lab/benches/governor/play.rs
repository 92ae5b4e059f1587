//! One run of one rule.

use std::collections::VecDeque;

use super::load::{LoadProfile, simulate_load};
use super::rivals::LevelRule;

/// Totals over all runs.
#[derive(Clone, Debug, Default)]
pub struct Score {
    frames: usize,
    missed: usize,
    quality: f64,
    switches: usize,
    /// Frames until the quality level settled, per step upwards and downwards of the load.
    settled: [Vec<usize>; 2],
}

impl Score {
    /// Returns the fraction of the frames over the budget.
    pub fn miss_fraction(&self) -> f64 {
        self.missed as f64 / self.frames as f64
    }

    /// Returns the mean quality.
    pub fn mean_quality(&self) -> f64 {
        self.quality / self.frames as f64
    }

    /// Returns the quality level changes per 1800 frames.
    pub fn switches_per_minute(&self) -> f64 {
        self.switches as f64 * 1800.0 / self.frames as f64
    }

    /// Returns the `p` quantile of the frames that a step took to settle, over the steps where the load fell or rose.
    pub fn settling_frames(&self, fell: bool, p: f64) -> usize {
        let mut frames = self.settled[usize::from(fell)].clone();
        frames.sort_unstable();
        let last = frames.len().saturating_sub(1);
        frames.get((p * last as f64).round() as usize).copied().unwrap_or(0)
    }
}

/// Plays `frames` frames of a seed: each has the level picked when it begins, and its time is known after
/// `profile.delay_frames` more frames have begun.
pub fn simulate(
    rule: &mut dyn LevelRule,
    costs: &[f64],
    budget: f64,
    profile: &LoadProfile,
    frames: usize,
    seed: u64,
    score: &mut Score,
) {
    let trace = simulate_load(profile, frames, seed);
    let mut under_way = VecDeque::with_capacity(profile.delay_frames + 1);
    let mut levels = Vec::with_capacity(frames);
    for (frame, &(load, _)) in trace.iter().enumerate() {
        if under_way.len() > profile.delay_frames
            && let Some((level, took)) = under_way.pop_front()
        {
            rule.record(level, took, frame);
        }
        let level = rule.choose_level(load);
        let took = load * costs[level];
        under_way.push_back((level, took));
        score.missed += usize::from(took > budget);
        score.quality += 0.8 + 0.2 * level as f64 / (costs.len() - 1) as f64;
        score.switches += usize::from(levels.last().is_some_and(|&last| last != level));
        levels.push(level);
    }
    score.frames += frames;
    let mut started = most_frequent(&levels[..profile.step_frames.min(frames)], costs.len());
    for (step, levels) in levels.chunks(profile.step_frames).enumerate().skip(1) {
        let first = step * profile.step_frames;
        let (before, after) = (trace[first - 1].1, trace[first].1);
        // Settled: within one of the level that most of the step's frames have, from there on for two seconds.
        let most = most_frequent(levels, costs.len());
        let near = |levels: &[usize]| levels.iter().all(|level| level.abs_diff(most) <= 1);
        // A step that needs no other level says nothing.
        if near(&[started]) {
            started = most;
            continue;
        }
        started = most;
        let settled = (0..levels.len()).find(|&from| near(&levels[from..(from + 60).min(levels.len())]));
        score.settled[usize::from(after < before)].push(settled.unwrap_or(levels.len()));
    }
}

fn most_frequent(levels: &[usize], count: usize) -> usize {
    let mut counts = vec![0; count];
    levels.iter().for_each(|&level| counts[level] += 1);
    counts.iter().enumerate().max_by_key(|(_, count)| **count).map_or(0, |(level, _)| level)
}
