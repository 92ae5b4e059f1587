//! The CPU executor: every core, the best vector instructions that the machine has, nothing allocated per pair.
//!
//! One sweep over the rows, some at a time, so that what is made of them stays in the cache: costs, the paths along the
//! rows, the path down, and the winners.

mod census;
mod cost;
mod path;
mod winner;

use std::iter;
use std::sync::atomic::AtomicBool;

use census::Census;
use cost::Costs;
use path::{Columns, Rows, STRIPE, States};
use pulp::Arch;
use winner::{Eyes, Winners};

use super::executor::Executor;
use super::fixed;
use super::penalty::Penalties;
use crate::compute::GpuError;
use crate::compute::aligned::Aligned;
use crate::compute::simd;
use crate::compute::thread_pool::{DisjointParts, ThreadPool};

/// Rows whose values lie side by side, `[column][row][disparity]`, as one part of the work.
const GROUP: usize = 4;

/// Matches pairs of one size on the CPU.
pub struct CpuExecutor {
    width: usize,
    height: usize,
    disparities: usize,
    arch: Arch,
    penalties: Penalties,
    left: Census,
    right: Census,
    stripes: usize,
    /// Groups that are worked on at a time.
    chunk: usize,
    costs: Aligned<u8>,
    /// Of a chunk, laid out as the costs.
    sums: Aligned<u8>,
    /// Of the paths down the columns of each stripe.
    states: Vec<States>,
    members: Vec<Member>,
    /// Flags with which [`DisjointParts`] hands each part to one thread only, for two buffers at a time.
    taken: [Vec<AtomicBool>; 2],
}

/// Memory of one thread.
struct Member {
    states: States,
    eyes: Eyes,
}

impl CpuExecutor {
    /// For pairs of this size, and at least as many disparities, at most 256.
    pub fn new((width, height): (usize, usize), disparities: usize, threads: usize) -> Self {
        let disparities = fixed::range(disparities);
        let stripes = width.div_ceil(STRIPE);
        // Two for each of a few threads: they wait less for each other.
        let chunk = threads + threads.min(4);
        let group_bytes = stripes * STRIPE * GROUP * disparities;
        let member = || Member { states: States::new(2 * GROUP, disparities), eyes: Eyes::new(width, disparities) };
        let flags = || iter::repeat_with(AtomicBool::default);
        // The census shares out padded rows, the paths down the columns stripes of groups.
        let most_parts = (height + 2 * census::REACH).max(chunk * stripes);
        Self {
            width,
            height,
            disparities,
            arch: Arch::new(),
            penalties: Penalties::new(),
            left: Census::new((width, height), false, 0),
            right: Census::new((width, height), true, disparities),
            stripes,
            chunk,
            costs: Aligned::zeros(chunk * group_bytes),
            sums: Aligned::zeros(chunk * group_bytes),
            states: iter::repeat_with(|| States::new(STRIPE, disparities)).take(stripes).collect(),
            members: iter::repeat_with(member).take(threads).collect(),
            taken: [(); 2].map(|()| flags().take(most_parts).collect()),
        }
    }

    /// Matches a pair, whose census is known, with `N` disparities: chunk by chunk from the top.
    fn match_range<const N: usize>(
        &mut self,
        left: &[u8],
        likely: Option<&[u16]>,
        workers: &mut ThreadPool,
        out: &mut [u16],
    ) {
        let groups = self.height.div_ceil(GROUP);
        for first in (0..groups).step_by(self.chunk) {
            let groups = (first, self.chunk.min(groups - first));
            self.along_rows::<N>(groups, left, likely, workers);
            self.along_columns::<N>(groups, left, workers);
            self.pick_winners::<N>(groups, workers, out);
        }
    }

    /// Bytes of the costs of a group of rows.
    fn group_bytes(&self) -> usize {
        self.stripes * STRIPE * GROUP * self.disparities
    }

    /// Computes the costs of `groups` from number `first` on, and the sums of the paths along their rows.
    fn along_rows<const N: usize>(
        &mut self,
        (first, groups): (usize, usize),
        left: &[u8],
        likely: Option<&[u16]>,
        workers: &mut ThreadPool,
    ) {
        let (width, height, arch, bytes) = (self.width, self.height, self.arch, self.group_bytes());
        let [cost_taken, sum_taken] = &mut self.taken;
        let costs = DisjointParts::new(&mut self.costs[..groups * bytes], bytes, cost_taken);
        let sums = DisjointParts::new(&mut self.sums[..groups * bytes], bytes, sum_taken);
        let (census, penalties) = ((&self.left, &self.right), &self.penalties);
        workers.run_with(&mut self.members, groups, &|member, part| {
            let y = (first + part) * GROUP;
            // Costs are sums over three rows, so one above and one below the group are read, too.
            let mut codes = [[[&[][..]; census::PLANES]; 2]; cost::ROWS];
            for (k, codes) in codes.iter_mut().enumerate() {
                let y = (y + k).saturating_sub(1).min(height - 1);
                *codes = [census.0.row(y), census.1.row(y)];
            }
            let costs = costs.part(part);
            arch.dispatch(Costs::<N> { codes, width, out: costs });
            let pixels = y * width..(y + GROUP).min(height) * width;
            if let Some(likely) = likely {
                cost::favour::<N>(&likely[pixels.clone()], width, costs);
            }
            let luma = &left[pixels];
            let (states, sums) = (&mut member.states, sums.part(part));
            arch.dispatch(Rows::<N> { costs, luma, width, penalties, states, sums });
        });
    }

    /// Adds the path down the groups, which leaves the sums of all where the costs were.
    fn along_columns<const N: usize>(
        &mut self,
        (first, groups): (usize, usize),
        left: &[u8],
        workers: &mut ThreadPool,
    ) {
        let (width, height, arch, stripes) = (self.width, self.height, self.arch, self.stripes);
        let bytes = self.group_bytes();
        let stripe_len = bytes / stripes;
        let [cost_taken, state_taken] = &mut self.taken;
        let (sums, penalties) = (&*self.sums, &self.penalties);
        let costs = DisjointParts::new(&mut self.costs[..groups * bytes], stripe_len, cost_taken);
        let states = DisjointParts::new(&mut self.states, 1, state_taken);
        // Downwards a row needs the one above it: stripes of columns are what threads can share out.
        workers.run(stripes, &|stripe| {
            let states = &mut states.part(stripe)[0];
            for k in 0..groups {
                let y = (first + k) * GROUP;
                let part = k * stripes + stripe;
                arch.dispatch(Columns::<N> {
                    costs: costs.part(part),
                    sums: &sums[part * stripe_len..(part + 1) * stripe_len],
                    rows: (y, GROUP.min(height - y)),
                    luma: (left, width),
                    columns: (stripe * STRIPE, width.min((stripe + 1) * STRIPE)),
                    penalties,
                    states,
                });
            }
        });
    }

    /// Writes the disparities that cost least in the groups, and that both eyes agree on, to `out`.
    fn pick_winners<const N: usize>(
        &mut self,
        (first, groups): (usize, usize),
        workers: &mut ThreadPool,
        out: &mut [u16],
    ) {
        let (width, height, arch, bytes) = (self.width, self.height, self.arch, self.group_bytes());
        let rows = first * GROUP..((first + groups) * GROUP).min(height);
        // The paths down the columns left the sums there.
        let sums = &self.costs;
        let out = DisjointParts::new(&mut out[rows.start * width..rows.end * width], GROUP * width, &mut self.taken[0]);
        workers.run_with(&mut self.members, groups, &|member, part| {
            let sums = &sums[part * bytes..(part + 1) * bytes];
            arch.dispatch(Winners::<N> { sums, width, eyes: &mut member.eyes, out: out.part(part) });
        });
    }
}

impl Executor for CpuExecutor {
    fn describe(&self) -> String {
        format!("cpu, {} threads, {}", self.members.len(), simd::name(self.arch))
    }

    fn winners(
        &mut self,
        [left, right]: [&[u8]; 2],
        likely: Option<&[u16]>,
        workers: &mut ThreadPool,
        out: &mut [u16],
    ) -> Result<(), GpuError> {
        let Self { arch, taken, .. } = self;
        self.left.compute(left, workers, *arch, &mut taken[0]);
        self.right.compute(right, workers, *arch, &mut taken[0]);
        match self.disparities {
            16 => self.match_range::<16>(left, likely, workers, out),
            32 => self.match_range::<32>(left, likely, workers, out),
            64 => self.match_range::<64>(left, likely, workers, out),
            96 => self.match_range::<96>(left, likely, workers, out),
            128 => self.match_range::<128>(left, likely, workers, out),
            192 => self.match_range::<192>(left, likely, workers, out),
            _ => self.match_range::<256>(left, likely, workers, out),
        }
        Ok(())
    }
}
