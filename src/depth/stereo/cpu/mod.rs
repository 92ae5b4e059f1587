//! The CPU executor: every core, the best vector instructions that the machine has, nothing allocated per pair.

mod census;
mod cost;
mod path;
mod prior;
mod semi_global;
mod speckle;
mod sweep;
mod winner;

use prior::Prior;
use semi_global::SemiGlobal;
use speckle::Speckles;

use super::executor::Executor;
use super::fixed::FILLED;
use super::gaps;
use crate::compute::GpuError;
use crate::compute::bands::Bands;
use crate::compute::thread_pool::ThreadPool;

/// Rows whose values lie side by side, `[column][row][disparity]`, as one part of the work.
const GROUP: usize = 4;

/// Matches pairs of one size on the CPU.
pub struct CpuExecutor {
    width: usize,
    /// Islands of up to so many pixels are dropped.
    island: u32,
    prior: Prior,
    semi_global: SemiGlobal,
    speckles: Speckles,
}

impl CpuExecutor {
    /// For pairs of this size, and at least as many disparities, at most 256; drops islands of up to `island` pixels.
    pub fn new(size: (usize, usize), disparities: usize, island: u32, threads: usize) -> Self {
        Self {
            width: size.0,
            island,
            prior: Prior::new(size.0),
            semi_global: SemiGlobal::new(size, disparities, threads),
            speckles: Speckles::new(size.0 * size.1),
        }
    }
}

impl Executor for CpuExecutor {
    fn describe(&self) -> String {
        self.semi_global.describe()
    }

    fn disparities(&mut self, eyes: [&[u8]; 2], workers: &mut ThreadPool, out: &mut [u16]) -> Result<(), GpuError> {
        let Self { width, prior, semi_global, speckles, .. } = self;
        let width = *width;
        semi_global.winners(eyes, prior.likely(eyes[0], workers), workers, out);
        speckles.remove(out, width, self.island, workers);
        // Before filling: what was not matched says nothing about the next pair.
        prior.keep(eyes[0], out);
        let bands = Bands::new(out.len() / width, 1, workers).split(out, width);
        workers.run_each(bands, &|band: &mut [u16]| {
            for row in band.chunks_exact_mut(width) {
                let first = gaps::first_known(row).unwrap_or(width);
                gaps::fill_row(&mut row[first..], FILLED);
            }
        });
        Ok(())
    }
}
