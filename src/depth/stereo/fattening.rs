//! Corrects foreground fattening: moves depth edges of near objects to their colour edges.
//!
//! Matching compares windows, and one across an outline matches best at the disparity of the nearer surface, which
//! grows by up to the radius of the window (Scharstein and Szeliski, *A taxonomy and evaluation of dense two-frame
//! stereo correspondence algorithms*, IJCV 2002). So each pixel beside a depth discontinuity is classified anew as one
//! of the two surfaces that meet there, by the likelihood of its colour: a kernel density estimate from samples of
//! both. The number of samples does not count, as the nearer surface has too many.

mod classify;
mod discontinuities;
mod guide;

use std::iter;
use std::sync::atomic::AtomicBool;

use classify::{ClassifyRow, LANES};
use discontinuities::UncertainPixels;
use guide::Guide;
use pulp::Arch;

use super::color_similarity::Colors;
use crate::compute::thread_pool::{DisjointParts, ThreadPool};

/// Corrects maps of one size; owns its buffers.
pub struct FatteningCorrection {
    width: usize,
    uncertain: UncertainPixels,
    guide: Guide,
    /// A flag per row, with which [`DisjointParts`] ensures that only one thread writes it.
    taken: Vec<AtomicBool>,
    arch: Arch,
}

impl FatteningCorrection {
    /// Allocates for maps of this size.
    pub fn new((width, height): (usize, usize)) -> Self {
        Self {
            width,
            uncertain: UncertainPixels::new((width, height)),
            guide: Guide::new(width * height),
            taken: iter::repeat_with(AtomicBool::default).take(height).collect(),
            arch: Arch::new(),
        }
    }

    /// Writes `found` to `into`, with the pixels beside depth discontinuities classified anew. All disparities of
    /// `found` count as known; `luma` is its left picture.
    pub fn correct(
        &mut self,
        found: &[u16],
        into: &mut [u16],
        luma: &[u8],
        colors: Option<Colors>,
        workers: &mut ThreadPool,
    ) {
        let Self { width, uncertain, guide, taken, arch } = self;
        let (width, arch) = (*width, *arch);
        into.copy_from_slice(found);
        if width < LANES {
            return;
        }
        uncertain.find(found, workers, arch);
        let guide = guide.fill_channels(luma, colors, width, workers, taken);
        let (height, other_sides) = (found.len() / width, uncertain.other_sides());
        let out = DisjointParts::new(into, width, taken);
        workers.run(height, &|y| arch.dispatch(ClassifyRow { found, other_sides, guide, width, y, out: out.part(y) }));
    }
}

#[cfg(test)]
mod tests;
