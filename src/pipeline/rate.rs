//! With how much effort depth is made, and how many frames share a map: the ladder of the depth stage.

use std::sync::atomic::{AtomicU64, Ordering};

use super::held::Held;
use super::quality::deadline_ns;
use crate::budget::{Governor, Sample};
use crate::frame::{ColorImage, DepthMap};
use crate::optics::CocField;

/// Picks what there is time for: where time is short, depth is first made with less effort, if its source has a choice,
/// then for every second or third frame only, and the others take it over.
///
/// Depth comes before a finer blur than usual, and after the usual one: it may take what that leaves of the time until a
/// frame is due, half of its period at least.
pub(super) struct Rate<'a> {
    /// Cheapest first.
    rungs: Vec<Rung>,
    governor: Governor,
    period_ns: u64,
    /// How long the blur usually takes; 0 before that is known.
    blur_ns: &'a AtomicU64,
    /// Frames since depth was made, that one included.
    age: usize,
    /// The CoC of the last depth, while later frames may share both.
    last: Option<CocField>,
    /// The depth that goes with it.
    held: Held,
}

#[derive(Clone, Copy)]
struct Rung {
    /// Number of frames that share a depth map.
    frames: usize,
    effort: usize,
}

/// This part of a period goes by before depth is begun, and between the stages.
const LOST: u64 = 4;

impl<'a> Rate<'a> {
    /// A frame has `period_ns`, of which its blur will usually take `blur_ns`. `efforts` are the costs of the source's
    /// efforts, the finest, 1, at the end.
    pub(super) fn new(period_ns: u64, blur_ns: &'a AtomicU64, efforts: &[f64]) -> Self {
        let cheapest = efforts.first().copied().unwrap_or(1.0);
        let shared = [3, 2].map(|frames| (Rung { frames, effort: 0 }, cheapest / frames as f64));
        let unshared = efforts.iter().enumerate().map(|(effort, &cost)| (Rung { frames: 1, effort }, cost));
        let (rungs, costs): (Vec<Rung>, Vec<f64>) = shared.into_iter().chain(unshared).unzip();
        let governor = Governor::new(&costs, costs.len() - 1);
        Self { rungs, governor, period_ns, blur_ns, age: 0, last: None, held: Held::new() }
    }

    /// What depth may take of a frame's time, on average.
    fn allowed_ns(&self) -> u64 {
        let half_ns = self.period_ns / 2;
        match self.blur_ns.load(Ordering::Relaxed) {
            0 => half_ns,
            // One thread makes depth: it never has more than the period.
            blur_ns => (deadline_ns(self.period_ns) - self.period_ns / LOST)
                .saturating_sub(blur_ns)
                .clamp(half_ns, self.period_ns * 9 / 10),
        }
    }

    /// The effort for the next depth.
    pub(super) fn effort(&self) -> usize {
        self.rung().effort
    }

    fn rung(&self) -> Rung {
        self.rungs[self.governor.rung()]
    }

    /// Counts a frame; returns the CoC of the last depth if the frame is given both, `None` if it needs its own.
    pub(super) fn holds(&mut self) -> Option<CocField> {
        if self.age >= self.rung().frames {
            self.last = None;
        }
        self.age += 1;
        self.last
    }

    /// Nothing is held any more: the next frame's depth is made anew.
    pub(super) fn forget(&mut self) {
        self.last = None;
    }

    /// Gives a picture the depth that is held.
    pub(super) fn give_held(&self, map: &mut DepthMap, color: &ColorImage) {
        self.held.give(map, color);
    }

    /// Depth of a picture was made in `took_ns`, until `at_ns`: tells the governor, and keeps it if later frames may share it.
    pub(super) fn made(&mut self, (map, field): (&DepthMap, CocField), color: &ColorImage, took_ns: u64, at_ns: u64) {
        self.age = 1;
        // Its share for each of the frames.
        let took_ns = took_ns / self.rung().frames as u64;
        // The first one takes longer than any other: its memory is allocated then.
        if !self.held.is_empty() {
            self.governor.note(Sample { rung: self.governor.rung(), took_ns, at_ns }, self.allowed_ns());
        }
        // The first one in any case: then the memory is allocated, and not during a later frame.
        if self.rung().frames > 1 || self.held.is_empty() {
            self.held.keep(map, color);
            self.last = Some(field);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAST: f64 = 0.25;

    /// Which frames of 200 are given the depth of the one before, where making it takes so long, and the last effort.
    fn run(took_ns: u64, efforts: &[f64]) -> (Vec<bool>, usize) {
        run_beside(0, took_ns, efforts)
    }

    /// The same beside a blur that usually takes so long.
    fn run_beside(blur_ns: u64, took_ns: u64, efforts: &[f64]) -> (Vec<bool>, usize) {
        let blur_ns = AtomicU64::new(blur_ns);
        let mut rate = Rate::new(32_000_000, &blur_ns, efforts);
        let map = DepthMap::new(2, 2);
        let frame = |now_ns| {
            if rate.holds().is_some() {
                return true;
            }
            let took_ns = (took_ns as f64 * efforts[rate.effort()]) as u64;
            rate.made((&map, CocField::Uniform { radius_px: 1.0 }), &ColorImage::new(2, 2), took_ns, now_ns);
            false
        };
        let held = (1..=200).map(|frame| frame * 33_000_000).map(frame).collect();
        (held, rate.effort())
    }

    #[test]
    fn depth_is_made_as_often_as_there_is_time() {
        for (took_ms, every) in [(10, 1), (20, 2), (40, 3), (400, 3)] {
            let (held, effort) = run(took_ms * 1_000_000, &[1.0]);
            assert!(!held[0], "the first frame has no other to take it from");
            let made: Vec<usize> = (20..200).filter(|&frame| !held[frame]).collect();
            assert!(made.windows(2).all(|pair| pair[1] - pair[0] == every), "{took_ms} ms: {made:?}");
            assert_eq!(effort, 0);
        }
    }

    #[test]
    fn depth_has_what_the_blur_leaves() {
        let ms = 1_000_000;
        for (blur_ms, took_ms, all) in
            [(10, 26, true), (10, 40, false), (30, 26, false), (100, 14, true), (100, 20, false)]
        {
            let (held, _) = run_beside(blur_ms * ms, took_ms * ms, &[1.0]);
            assert_eq!(held[20..].iter().all(|held| !held), all, "{took_ms} ms beside {blur_ms} ms");
        }
    }

    #[test]
    fn less_effort_comes_before_fewer_maps() {
        for (took_ms, every, effort) in [(10, 1, 1), (20, 1, 0), (50, 1, 0), (100, 2, 0), (160, 3, 0)] {
            let (held, last) = run(took_ms * 1_000_000, &[FAST, 1.0]);
            let made: Vec<usize> = (20..200).filter(|&frame| !held[frame]).collect();
            assert!(made.windows(2).all(|pair| pair[1] - pair[0] == every), "{took_ms} ms: {made:?}");
            assert_eq!(last, effort, "{took_ms} ms");
        }
    }
}
