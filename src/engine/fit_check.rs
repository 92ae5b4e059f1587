//! Checks, in some of the first frames, whether the depth of a stream is aligned with its pictures.

use crate::depth::agreement::EdgeAlignment;
use crate::depth::misalignment::Misalignment;
use crate::depth::refine::MapCorrection;
use crate::frame::{ColorImage, DepthMap};

/// Every fifth frame is checked, as neighbouring frames are alike.
const FRAME_STEP: u32 = 5;
/// This many frames of a stream must agree on a verdict.
const REQUIRED_FRAMES: usize = 3;
/// The check gives up after this many frames.
const MAX_FRAMES: u32 = 300;

/// A misalignment that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// Depth and colour are not registered.
    Unregistered,
    /// The edges are misaligned; this correction aligns them.
    Misaligned(Misalignment, MapCorrection),
}

/// Checks frames until it reaches a verdict or gives up.
#[derive(Debug)]
pub struct FitCheck {
    /// Number of agreeing frames that make a verdict.
    required: usize,
    frames: u32,
    unregistered: usize,
    corrections: Vec<(Misalignment, MapCorrection)>,
    is_aligned: bool,
}

impl FitCheck {
    /// Creates the check for a stream of `frames` frames, if known: a single picture decides alone.
    pub fn new(frames: Option<u64>) -> Self {
        let required = if frames == Some(1) { 1 } else { REQUIRED_FRAMES };
        Self { required, frames: 0, unregistered: 0, corrections: Vec::new(), is_aligned: false }
    }

    /// Returns whether a frame was seen whose depth edges and picture edges coincide.
    pub fn is_aligned(&self) -> bool {
        self.is_aligned
    }

    /// Checks the next frame with its raw depth; returns a verdict at most once.
    pub fn check_frame(&mut self, map: &DepthMap, color: &ColorImage) -> Option<Verdict> {
        if self.frames >= MAX_FRAMES {
            return None;
        }
        self.frames += 1;
        if self.frames % FRAME_STEP != 1 {
            return None;
        }
        let outlines = EdgeAlignment::measure(map, color);
        let misalignment = Misalignment::from_alignment(outlines, map, color);
        match misalignment.and_then(|misalignment| Some((misalignment, misalignment.correction(map, color)?))) {
            Some(correction) => self.corrections.push(correction),
            None if misalignment.is_some() => self.unregistered += 1,
            None if outlines == EdgeAlignment::Aligned => (self.frames, self.is_aligned) = (MAX_FRAMES, true),
            None => {}
        }
        let verdict = match () {
            () if self.unregistered == self.required => Some(Verdict::Unregistered),
            // The smallest correction.
            () if self.corrections.len() == self.required => self
                .corrections
                .iter()
                .min_by_key(|(_, correction)| (correction.distance_px.abs(), correction.coarsest))
                .map(|&(misalignment, correction)| Verdict::Misaligned(misalignment, correction)),
            () => None,
        };
        if verdict.is_some() {
            self.frames = MAX_FRAMES;
        }
        verdict
    }
}
