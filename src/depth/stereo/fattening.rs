//! Foreground fattening, undone: near things are given back the outline that their colour has.
//!
//! What is compared of two eyes are windows, and one that reaches over an outline matches best as the nearer side does,
//! which so grows by up to the window's reach (Scharstein and Szeliski, *A taxonomy and evaluation of dense two-frame
//! stereo correspondence algorithms*, IJCV 2002). So the pixels beside each jump of the disparity are decided anew
//! between the two surfaces that meet there, by how alike each is to the pixels of either around it: the likelihood of
//! its colour, estimated with a kernel from samples of both, not how many of them there are, as the nearer has too many.

mod guide;
mod jumps;
mod vote;

use std::iter;
use std::sync::atomic::AtomicBool;

use guide::Guide;
use jumps::Doubts;
use pulp::Arch;
use vote::{LANES, Row};

use super::color_similarity::Colors;
use crate::compute::thread_pool::{DisjointParts, ThreadPool};

/// Decides anew beside jumps, in maps of one size; owns the memory for it.
pub struct Fattening {
    width: usize,
    doubts: Doubts,
    guide: Guide,
    /// A flag for each row, with which [`DisjointParts`] hands it to one thread only.
    taken: Vec<AtomicBool>,
    arch: Arch,
}

impl Fattening {
    /// For maps of this size.
    pub fn new((width, height): (usize, usize)) -> Self {
        Self {
            width,
            doubts: Doubts::new((width, height)),
            guide: Guide::new(width * height),
            taken: iter::repeat_with(AtomicBool::default).take(height).collect(),
            arch: Arch::new(),
        }
    }

    /// Writes `found` to `into`, with what lies beside its jumps decided anew. All disparities of `found` count as known;
    /// `luma` is its left picture.
    pub fn correct(
        &mut self,
        found: &[u16],
        into: &mut [u16],
        luma: &[u8],
        colors: Option<Colors>,
        workers: &mut ThreadPool,
    ) {
        let Self { width, doubts, guide, taken, arch } = self;
        let (width, arch) = (*width, *arch);
        into.copy_from_slice(found);
        if width < LANES {
            return;
        }
        doubts.find(found, workers, arch);
        let guide = guide.of(luma, colors, width, workers, taken);
        let (height, others) = (found.len() / width, doubts.others());
        let out = DisjointParts::new(into, width, taken);
        workers.run(height, &|y| arch.dispatch(Row { found, others, guide, width, y, out: out.part(y) }));
    }
}

#[cfg(test)]
mod tests;
