//! One run of one rule.

use std::collections::VecDeque;

use super::load::{Weather, trace};
use super::rivals::Picker;

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
    pub fn misses(&self) -> f64 {
        self.missed as f64 / self.frames as f64
    }

    /// Returns the mean quality.
    pub fn quality(&self) -> f64 {
        self.quality / self.frames as f64
    }

    /// Returns the quality level changes per 1800 frames.
    pub fn switches_per_minute(&self) -> f64 {
        self.switches as f64 * 1800.0 / self.frames as f64
    }

    /// Returns the `p` quantile of the frames that a step took to settle, over the steps where the load fell or rose.
    pub fn settled(&self, fell: bool, p: f64) -> usize {
        let mut frames = self.settled[usize::from(fell)].clone();
        frames.sort_unstable();
        let last = frames.len().saturating_sub(1);
        frames.get((p * last as f64).round() as usize).copied().unwrap_or(0)
    }
}

/// Plays `frames` frames of a seed: each has the level picked when it begins, and its time is known after
/// `weather.late` more frames have begun.
pub fn play(
    picker: &mut dyn Picker,
    costs: &[f64],
    budget: f64,
    weather: &Weather,
    frames: usize,
    seed: u64,
    score: &mut Score,
) {
    let trace = trace(weather, frames, seed);
    let mut under_way = VecDeque::with_capacity(weather.late + 1);
    let mut rungs = Vec::with_capacity(frames);
    for (frame, &(load, _)) in trace.iter().enumerate() {
        if under_way.len() > weather.late
            && let Some((rung, took)) = under_way.pop_front()
        {
            picker.record(rung, took, frame);
        }
        let rung = picker.rung(load);
        let took = load * costs[rung];
        under_way.push_back((rung, took));
        score.missed += usize::from(took > budget);
        score.quality += 0.8 + 0.2 * rung as f64 / (costs.len() - 1) as f64;
        score.switches += usize::from(rungs.last().is_some_and(|&last| last != rung));
        rungs.push(rung);
    }
    score.frames += frames;
    let mut started = most_frequent(&rungs[..weather.step_frames.min(frames)], costs.len());
    for (step, rungs) in rungs.chunks(weather.step_frames).enumerate().skip(1) {
        let first = step * weather.step_frames;
        let (before, after) = (trace[first - 1].1, trace[first].1);
        // Settled: within one of the level that most of the step's frames have, from there on for two seconds.
        let most = most_frequent(rungs, costs.len());
        let near = |rungs: &[usize]| rungs.iter().all(|rung| rung.abs_diff(most) <= 1);
        // A step that needs no other level says nothing.
        if near(&[started]) {
            started = most;
            continue;
        }
        started = most;
        let settled = (0..rungs.len()).find(|&from| near(&rungs[from..(from + 60).min(rungs.len())]));
        score.settled[usize::from(after < before)].push(settled.unwrap_or(rungs.len()));
    }
}

fn most_frequent(rungs: &[usize], count: usize) -> usize {
    let mut counts = vec![0; count];
    rungs.iter().for_each(|&rung| counts[rung] += 1);
    counts.iter().enumerate().max_by_key(|(_, count)| **count).map_or(0, |(rung, _)| rung)
}
