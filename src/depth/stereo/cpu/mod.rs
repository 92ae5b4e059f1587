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
use cost::{Costs, Differences};
use path::{Columns, Order, Penalties, Rows, STRIPE, TOGETHER};
use pulp::Arch;
use winner::Winners;

use super::Executor;
use crate::compute::GpuError;
use crate::compute::aligned::Aligned;
use crate::compute::simd;
use crate::compute::team::{Shelf, Team};

/// Rows that are worked on at a time; a multiple of [`TOGETHER`].
const CHUNK: usize = 16;

/// Matches pairs of one size on the CPU.
pub struct CpuExecutor {
    width: usize,
    height: usize,
    disparities: usize,
    arch: Arch,
    penalties: Penalties,
    left: Census,
    right: Census,
    /// Columns of the volumes: whole stripes.
    columns: usize,
    /// Of a chunk of rows, `[row][column][disparity]`.
    costs: Aligned<u8>,
    /// Of all rows, laid out as the costs.
    sums: Aligned<u8>,
    /// States of the paths along columns, by the parity of the row: stripe by stripe.
    states: [Aligned<u8>; 2],
    least: Vec<u8>,
    members: Vec<Member>,
    taken: [Vec<AtomicBool>; 4],
}

/// Memory of one thread.
struct Member {
    /// Differences of [`TOGETHER`] rows, and of one above and one below.
    differences: Aligned<u8>,
    states: Aligned<u8>,
    best: [Vec<u16>; 2],
}

impl CpuExecutor {
    /// For pairs of this size, and as many disparities, a multiple of 16 and at most 256.
    pub fn new((width, height): (usize, usize), disparities: usize, threads: usize) -> Self {
        let columns = width.next_multiple_of(STRIPE);
        let row = columns * disparities;
        let stripes = columns / STRIPE;
        let member = || Member {
            differences: Aligned::zeros((TOGETHER + 2) * row),
            states: Aligned::zeros(path::row_states(disparities)),
            best: [vec![0; width], vec![0; width + disparities]],
        };
        let mut states = [(); 2].map(|()| Aligned::zeros(stripes * path::column_states(disparities)));
        states.iter_mut().for_each(|states| states.fill(u8::MAX));
        let flags = || iter::repeat_with(AtomicBool::default);
        let most = (height + 2 * CHUNK).max(CHUNK * stripes);
        Self {
            width,
            height,
            disparities,
            arch: Arch::new(),
            penalties: Penalties::new(),
            left: Census::new((width, height), false, 0),
            right: Census::new((width, height), true, disparities),
            columns,
            costs: Aligned::zeros(CHUNK * row),
            sums: Aligned::zeros(height * row),
            states,
            least: vec![0; columns],
            members: iter::repeat_with(member).take(threads).collect(),
            taken: [(); 4].map(|()| flags().take(most).collect()),
        }
    }

    fn with_lanes<const L: usize>(&mut self, left: &[u8], team: &mut Team, out: &mut [u16]) {
        let chunks = self.height.div_ceil(CHUNK);
        for chunk in 0..chunks {
            self.along_rows::<L>(chunk, left, team, true);
            self.along_columns::<L>(chunk, left, team, false);
        }
        for chunk in (0..chunks).rev() {
            // What the last chunk left is still there.
            if chunk + 1 < chunks {
                self.along_rows::<L>(chunk, left, team, false);
            }
            self.along_columns::<L>(chunk, left, team, true);
            self.win::<L>(chunk, team, out);
        }
    }

    /// First row and number of rows of a chunk.
    fn rows_of(&self, chunk: usize) -> (usize, usize) {
        (chunk * CHUNK, CHUNK.min(self.height - chunk * CHUNK))
    }

    /// The costs of a chunk, and, if `paths`, the sums of the paths along its rows.
    fn along_rows<const L: usize>(&mut self, chunk: usize, left: &[u8], team: &mut Team, paths: bool) {
        let (first, rows) = self.rows_of(chunk);
        let Self { width, height, disparities, arch, penalties, columns, .. } = self;
        let (width, height, disparities, arch) = (*width, *height, *disparities, *arch);
        let stride = *columns * disparities;
        let [cost_taken, sum_taken, ..] = &mut self.taken;
        let costs = Shelf::new(&mut self.costs[..rows * stride], TOGETHER * stride, cost_taken);
        let sums = Shelf::new(&mut self.sums[first * stride..(first + rows) * stride], TOGETHER * stride, sum_taken);
        let (census, penalties) = ((&self.left, &self.right), &*penalties);
        team.run_with(&mut self.members, rows.div_ceil(TOGETHER), &|member, part| {
            let Member { differences, states, .. } = member;
            let costs = costs.part(part);
            let together = costs.len() / stride;
            let y = first + part * TOGETHER;
            let row_of = |k: usize| (y + k).saturating_sub(1).min(height - 1);
            for (k, out) in differences.chunks_exact_mut(stride).take(together + 2).enumerate() {
                let (left, right) = (census.0.row(row_of(k)), census.1.row(row_of(k)));
                arch.dispatch(Differences::<L> { left, right, width, disparities, out });
            }
            for (k, out) in costs.chunks_exact_mut(stride).enumerate() {
                let row = |k: usize| &differences[k * stride..(k + 1) * stride];
                arch.dispatch(Costs::<L> { rows: [row(k), row(k + 1), row(k + 2)], width, disparities, out });
            }
            if paths {
                let luma = &left[y * width..(y + together) * width];
                let sums = sums.part(part);
                arch.dispatch(Rows::<L> { costs, luma, width, stride, disparities, penalties, states, sums });
            }
        });
    }

    /// Adds the path down a chunk, or up.
    fn along_columns<const L: usize>(&mut self, chunk: usize, left: &[u8], team: &mut Team, up: bool) {
        let (first, rows) = self.rows_of(chunk);
        let Self { width, disparities, arch, penalties, columns, .. } = self;
        let (width, disparities, arch, penalties) = (*width, *disparities, *arch, &*penalties);
        let (stride, stripes) = (*columns * disparities, *columns / STRIPE);
        let [sum_taken, even_taken, odd_taken, least_taken] = &mut self.taken;
        let (costs, luma) = (&*self.costs, (left, width));
        let sums = Shelf::new(&mut self.sums[first * stride..(first + rows) * stride], STRIPE * disparities, sum_taken);
        let [even, odd] = &mut self.states;
        let even = Shelf::new(even, path::column_states(disparities), even_taken);
        let odd = Shelf::new(odd, path::column_states(disparities), odd_taken);
        let least = Shelf::new(&mut self.least, STRIPE, least_taken);
        let order = if up { Order::Up(rows) } else { Order::Down(rows) };
        team.run(stripes, &|stripe| {
            arch.dispatch(Columns::<L> {
                costs,
                first: stripe * STRIPE * disparities,
                stride,
                order,
                y: first,
                luma,
                columns: (stripe * STRIPE, width.min((stripe + 1) * STRIPE)),
                disparities,
                penalties,
                states: [even.part(stripe), odd.part(stripe)],
                least: least.part(stripe),
                sums: &sums,
                part: (stripes, stripe),
            });
        });
    }

    /// The winners of a chunk.
    fn win<const L: usize>(&mut self, chunk: usize, team: &mut Team, out: &mut [u16]) {
        let (first, rows) = self.rows_of(chunk);
        let (width, disparities, arch) = (self.width, self.disparities, self.arch);
        let stride = self.columns * disparities;
        let sums = &self.sums[first * stride..];
        let out = Shelf::new(&mut out[first * width..(first + rows) * width], width, &mut self.taken[0]);
        team.run_with(&mut self.members, rows, &|member, row| {
            let sums = &sums[row * stride..(row + 1) * stride];
            let [left, right] = &mut member.best;
            arch.dispatch(Winners::<L> { sums, width, disparities, best: [left, right], out: out.part(row) });
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
            n if n % 64 == 0 => self.with_lanes::<64>(left, team, out),
            n if n % 32 == 0 => self.with_lanes::<32>(left, team, out),
            _ => self.with_lanes::<16>(left, team, out),
        }
        Ok(())
    }
}
