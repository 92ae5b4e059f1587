//! Semi-global matching with a left-right consistency check.
//!
//! Each work item is a group of rows: one thread computes everything from the costs to the winners, so that
//! intermediate results stay in the cache of one core. Only the paths down the columns pass from group to group, and so
//! from thread to thread.

use std::sync::atomic::AtomicBool;
use std::{array, iter};

use pulp::Arch;

use super::super::fixed;
use super::super::penalty::Penalties;
use super::GROUP;
use super::census::{self, Census};
use super::path::{Paths, StepPenalties};
use super::sweep::{BLOCK, Cells, ConsistencyCheck, DownPaths, SweepFromLeft, SweepFromRight};
use super::winner::Winners;
use crate::compute::simd;
use crate::compute::thread_pool::wavefront::Wavefront;
use crate::compute::thread_pool::{DisjointParts, ThreadPool};

/// Matches pairs of one size.
pub struct SemiGlobal {
    width: usize,
    height: usize,
    disparities: usize,
    arch: Arch,
    penalties: Penalties,
    left: Census,
    right: Census,
    /// The paths down the columns, by block.
    down: Wavefront<DownPaths>,
    scratch: Vec<Scratch>,
    /// Flags with which [`DisjointParts`] ensures that only one thread writes each part.
    taken: Vec<AtomicBool>,
}

/// Buffers of one thread.
struct Scratch {
    p2: StepPenalties,
    cells: Cells,
    paths: Paths,
    winners: Winners,
}

impl SemiGlobal {
    /// Allocates for pairs of this size and at least `disparities` candidates, at most 256.
    pub fn new((width, height): (usize, usize), disparities: usize, threads: usize) -> Self {
        let disparities = fixed::candidate_count(disparities);
        let new_scratch = || Scratch {
            p2: StepPenalties::new(width),
            cells: Cells::new(width, disparities),
            paths: Paths::new(),
            winners: Winners::new(width, disparities),
        };
        Self {
            width,
            height,
            disparities,
            arch: Arch::new(),
            penalties: Penalties::new(),
            left: Census::new((width, height), false, 0),
            right: Census::new((width, height), true, disparities),
            down: Wavefront::new((0..width.div_ceil(BLOCK)).map(|_| DownPaths::new(disparities))),
            scratch: iter::repeat_with(new_scratch).take(threads).collect(),
            // The census transform distributes padded rows.
            taken: iter::repeat_with(AtomicBool::default).take(height + 2 * census::RADIUS).collect(),
        }
    }

    /// Matches a pair whose census codes are computed, with `N` disparities.
    fn match_disparities<const N: usize>(
        &mut self,
        left: &[u8],
        likely: Option<&[u16]>,
        workers: &mut ThreadPool,
        out: &mut [u16],
    ) {
        let Self { width, height, arch, ref penalties, .. } = *self;
        self.down.reset(DownPaths::clear);
        let (down, census) = (&self.down, [&self.left, &self.right]);
        let out = DisjointParts::new(out, GROUP * width, &mut self.taken);
        workers.run_with(&mut self.scratch, height.div_ceil(GROUP), &|Scratch { p2, cells, paths, winners }, part| {
            let mut blocks = down.block_iter(part);
            // Row 0 is the one above the group; beyond the borders the outermost rows repeat.
            let row = |k: usize| (part * GROUP + k).saturating_sub(1).min(height - 1);
            let pixels = |y: usize| y * width..(y + 1) * width;
            p2.compute(array::from_fn(|k| &left[pixels(row(k))]), penalties);
            // Costs are sums over three rows, so that one row above and one below the group are needed, too.
            let codes = array::from_fn(|k| census.map(|census| census.row(row(k))));
            let likely = likely.map(|likely| array::from_fn(|k| &likely[pixels(row(k + 1))]));
            paths.clear::<N>();
            arch.dispatch(SweepFromRight::<N> { codes, p2, likely, cells, paths });
            paths.clear::<N>();
            winners.clear();
            for first in (0..width).step_by(BLOCK) {
                let Some(mut down) = blocks.next_block() else { break };
                arch.dispatch(SweepFromLeft::<N> { p2, cells, first, paths, down: &mut down, winners });
            }
            arch.dispatch(ConsistencyCheck { winners, out: out.part(part) });
        });
    }

    /// Describes the executor.
    pub fn describe(&self) -> String {
        format!("cpu, {} threads, {}", self.scratch.len(), simd::instruction_set(self.arch))
    }

    /// Writes the disparities of the left picture to `out`, in fixed point, or unknown. `likely` has one more than the
    /// likely disparity of each pixel, or 0: that one and those beside it cost [`fixed::PRIOR_BONUS`] less.
    pub fn match_pair(
        &mut self,
        [left, right]: [&[u8]; 2],
        likely: Option<&[u16]>,
        workers: &mut ThreadPool,
        out: &mut [u16],
    ) {
        let Self { arch, taken, .. } = self;
        self.left.compute(left, workers, *arch, taken);
        self.right.compute(right, workers, *arch, taken);
        match self.disparities {
            16 => self.match_disparities::<16>(left, likely, workers, out),
            32 => self.match_disparities::<32>(left, likely, workers, out),
            64 => self.match_disparities::<64>(left, likely, workers, out),
            96 => self.match_disparities::<96>(left, likely, workers, out),
            128 => self.match_disparities::<128>(left, likely, workers, out),
            192 => self.match_disparities::<192>(left, likely, workers, out),
            _ => self.match_disparities::<256>(left, likely, workers, out),
        }
    }
}
