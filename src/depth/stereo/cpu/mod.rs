//! The CPU executor: every core, the best vector instructions that the machine has, nothing allocated per pair.
//!
//! Two sweeps over the rows, some at a time, so that what is made of them stays in the cache. Down: costs, the paths
//! along the rows, and the path down. Up: the costs again, which is cheaper than to keep them, the path up, and the
//! winners. Only the sums of the paths are kept for all pixels.

mod census;
mod cost;
mod path;
mod winner;

use std::iter;
use std::sync::atomic::AtomicBool;

use census::Census;
use cost::Costs;
use path::{Columns, Penalties, Rows, STRIPE, States, Volumes};
use pulp::Arch;
use winner::Winners;

use super::Executor;
use crate::compute::GpuError;
use crate::compute::aligned::Aligned;
use crate::compute::simd;
use crate::compute::team::{Shelf, Team};

/// Rows whose values lie side by side, `[column][row][disparity]`, as one part of the work.
const GROUP: usize = 4;
/// Groups that are worked on at a time.
const CHUNK: usize = 2;

/// As many disparities as the code is made for.
const RANGES: [usize; 7] = [16, 32, 64, 96, 128, 192, 256];

/// Matches pairs of one size on the CPU.
pub struct CpuExecutor {
    width: usize,
    height: usize,
    disparities: usize,
    arch: Arch,
    penalties: Penalties,
    left: Census,
    right: Census,
    /// Stripes of columns.
    stripes: usize,
    /// Of a chunk of groups.
    costs: Aligned<u8>,
    /// Of all groups.
    sums: Aligned<u8>,
    /// Of the paths along the columns of each stripe.
    states: Vec<States>,
    members: Vec<Member>,
    taken: [Vec<AtomicBool>; 3],
}

/// Memory of one thread.
struct Member {
    states: States,
    best: [Vec<u16>; 2],
}

impl CpuExecutor {
    /// For pairs of this size, and at least as many disparities, at most 256.
    pub fn new((width, height): (usize, usize), disparities: usize, threads: usize) -> Self {
        let disparities = RANGES.into_iter().find(|&range| range >= disparities).unwrap_or(RANGES[RANGES.len() - 1]);
        let stripes = width.div_ceil(STRIPE);
        let groups = height.div_ceil(GROUP);
        let group = stripes * STRIPE * GROUP * disparities;
        let member = || Member {
            states: States::new(2 * GROUP, disparities),
            best: [vec![0; GROUP * width], vec![0; GROUP * (width + disparities)]],
        };
        let flags = || iter::repeat_with(AtomicBool::default);
        let most = (height + 2 * census::REACH).max(CHUNK * stripes);
        Self {
            width,
            height,
            disparities,
            arch: Arch::new(),
            penalties: Penalties::new(),
            left: Census::new((width, height), false, 0),
            right: Census::new((width, height), true, disparities),
            stripes,
            costs: Aligned::zeros(CHUNK * group),
            sums: Aligned::zeros(groups * group),
            states: iter::repeat_with(|| States::new(STRIPE, disparities)).take(stripes).collect(),
            members: iter::repeat_with(member).take(threads).collect(),
            taken: [(); 3].map(|()| flags().take(most).collect()),
        }
    }

    fn match_range<const N: usize>(&mut self, left: &[u8], team: &mut Team, out: &mut [u16]) {
        let groups = self.height.div_ceil(GROUP);
        let chunks = groups.div_ceil(CHUNK);
        let chunk = |chunk: usize| (chunk * CHUNK, CHUNK.min(groups - chunk * CHUNK));
        for k in 0..chunks {
            self.along_rows::<N>(chunk(k), left, team, true);
            self.along_columns::<N>(chunk(k), left, team, false);
        }
        for k in (0..chunks).rev() {
            // The costs of the last chunk are still there.
            if k + 1 < chunks {
                self.along_rows::<N>(chunk(k), left, team, false);
            }
            self.along_columns::<N>(chunk(k), left, team, true);
            self.win::<N>(chunk(k), team, out);
        }
    }

    /// Bytes of a group of rows.
    fn group(&self) -> usize {
        self.stripes * STRIPE * GROUP * self.disparities
    }

    /// The costs of the groups, and, if `paths`, the sums of the paths along their rows.
    fn along_rows<const N: usize>(
        &mut self,
        (first, groups): (usize, usize),
        left: &[u8],
        team: &mut Team,
        paths: bool,
    ) {
        let (width, height, arch, group) = (self.width, self.height, self.arch, self.group());
        let [cost_taken, sum_taken, ..] = &mut self.taken;
        let costs = Shelf::new(&mut self.costs[..groups * group], group, cost_taken);
        let sums = Shelf::new(&mut self.sums[first * group..(first + groups) * group], group, sum_taken);
        let (census, penalties) = ((&self.left, &self.right), &self.penalties);
        team.run_with(&mut self.members, groups, &|member, part| {
            let y = (first + part) * GROUP;
            let mut codes = [[[&[][..]; census::PLANES]; 2]; cost::ROWS];
            for (k, codes) in codes.iter_mut().enumerate() {
                let y = (y + k).saturating_sub(1).min(height - 1);
                *codes = [census.0.row(y), census.1.row(y)];
            }
            let costs = costs.part(part);
            arch.dispatch(Costs::<N> { codes, width, out: costs });
            if paths {
                let luma = &left[y * width..(y + GROUP).min(height) * width];
                let (states, sums) = (&mut member.states, sums.part(part));
                arch.dispatch(Rows::<N> { costs, luma, width, penalties, states, sums });
            }
        });
    }

    /// Adds the path down the groups; or the path up, which leaves the sums of all where the costs were.
    fn along_columns<const N: usize>(
        &mut self,
        (first, groups): (usize, usize),
        left: &[u8],
        team: &mut Team,
        up: bool,
    ) {
        let (width, height, arch, group, stripes) = (self.width, self.height, self.arch, self.group(), self.stripes);
        let stripe_len = group / stripes;
        let [cost_taken, sum_taken, state_taken] = &mut self.taken;
        let penalties = &self.penalties;
        let costs = Shelf::new(&mut self.costs[..groups * group], stripe_len, cost_taken);
        let sums = Shelf::new(&mut self.sums[first * group..(first + groups) * group], stripe_len, sum_taken);
        let states = Shelf::new(&mut self.states, 1, state_taken);
        team.run(stripes, &|stripe| {
            let states = &mut states.part(stripe)[0];
            for k in 0..groups {
                let k = if up { groups - 1 - k } else { k };
                let y = (first + k) * GROUP;
                let (costs, sums) = (costs.part(k * stripes + stripe), sums.part(k * stripes + stripe));
                arch.dispatch(Columns::<N> {
                    volumes: if up { Volumes::Up { costs, sums } } else { Volumes::Down { costs, sums } },
                    rows: (y, GROUP.min(height - y)),
                    luma: (left, width),
                    columns: (stripe * STRIPE, width.min((stripe + 1) * STRIPE)),
                    penalties,
                    states,
                });
            }
        });
    }

    /// The winners of the groups.
    fn win<const N: usize>(&mut self, (first, groups): (usize, usize), team: &mut Team, out: &mut [u16]) {
        let (width, height, arch, group) = (self.width, self.height, self.arch, self.group());
        let rows = first * GROUP..((first + groups) * GROUP).min(height);
        let sums = &self.costs;
        let out = Shelf::new(&mut out[rows.start * width..rows.end * width], GROUP * width, &mut self.taken[0]);
        team.run_with(&mut self.members, groups, &|member, part| {
            let sums = &sums[part * group..(part + 1) * group];
            let [left, right] = &mut member.best;
            arch.dispatch(Winners::<N> { sums, width, best: [left, right], out: out.part(part) });
        });
    }
}

impl Executor for CpuExecutor {
    fn describe(&self) -> String {
        format!("cpu, {} threads, {}", self.members.len(), simd::name(self.arch))
    }

    fn winners(&mut self, left: &[u8], right: &[u8], team: &mut Team, out: &mut [u16]) -> Result<(), GpuError> {
        let Self { arch, taken, .. } = self;
        self.left.see(left, team, *arch, &mut taken[0]);
        self.right.see(right, team, *arch, &mut taken[0]);
        match self.disparities {
            16 => self.match_range::<16>(left, team, out),
            32 => self.match_range::<32>(left, team, out),
            64 => self.match_range::<64>(left, team, out),
            96 => self.match_range::<96>(left, team, out),
            128 => self.match_range::<128>(left, team, out),
            192 => self.match_range::<192>(left, team, out),
            _ => self.match_range::<256>(left, team, out),
        }
        Ok(())
    }
}
