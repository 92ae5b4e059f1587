//! Whether the depth of a stream fits its pictures, told from some of the first frames.

use crate::depth::agreement::Agreement;
use crate::depth::misfit::Misfit;
use crate::depth::refine::Mending;
use crate::frame::{ColorImage, DepthMap};

/// One of so many frames is looked at, as neighbours are alike.
const EVERY: u32 = 5;
/// So many frames of a stream that agree decide.
const DECISION: usize = 3;
/// After so many frames without a decision there will be none.
const LAST: u32 = 300;

/// What is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// Depth and colours are not registered.
    Unrelated,
    /// This mends it.
    Mend(Misfit, Mending),
}

/// Decides once.
#[derive(Debug)]
pub struct FitCheck {
    /// So many frames that agree decide.
    decision: usize,
    frames: u32,
    unrelated: usize,
    mendings: Vec<(Misfit, Mending)>,
    meets: bool,
}

impl FitCheck {
    /// For a stream of so many frames, where that is known: a picture on its own decides alone.
    pub fn of(frames: Option<u64>) -> Self {
        let decision = if frames == Some(1) { 1 } else { DECISION };
        Self { decision, frames: 0, unrelated: 0, mendings: Vec::new(), meets: false }
    }

    /// Whether a frame was seen whose outlines of depth and colour meet.
    pub fn meets(&self) -> bool {
        self.meets
    }

    /// Takes the next frame, with its depth as it was measured; says so, once, when it is clear that it does not fit.
    pub fn look(&mut self, map: &DepthMap, color: &ColorImage) -> Option<Verdict> {
        if self.frames >= LAST {
            return None;
        }
        self.frames += 1;
        if self.frames % EVERY != 1 {
            return None;
        }
        let outlines = Agreement::of(map, color);
        let misfit = Misfit::with(outlines, map, color);
        match misfit.and_then(|misfit| Some((misfit, misfit.mending(map, color)?))) {
            Some(mending) => self.mendings.push(mending),
            None if misfit.is_some() => self.unrelated += 1,
            None if outlines == Agreement::Meets => (self.frames, self.meets) = (LAST, true),
            None => {}
        }
        let verdict = match () {
            () if self.unrelated == self.decision => Some(Verdict::Unrelated),
            // The one that does the least.
            () if self.mendings.len() == self.decision => self
                .mendings
                .iter()
                .min_by_key(|(_, mending)| (mending.distance_px.abs(), mending.coarsest))
                .map(|&(misfit, mending)| Verdict::Mend(misfit, mending)),
            () => None,
        };
        if verdict.is_some() {
            self.frames = LAST;
        }
        verdict
    }
}
