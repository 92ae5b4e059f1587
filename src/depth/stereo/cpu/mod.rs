//! The CPU executor: multithreaded vector code, without allocations per pair.

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

/// Rows that are processed together as one work item, with values stored as `[column][row][disparity]`.
const GROUP: usize = 4;

/// Matches pairs of one size on the CPU.
pub struct CpuExecutor {
    width: usize,
    /// Islands of at most this many pixels are removed.
    island: u32,
    prior: Prior,
    semi_global: SemiGlobal,
    speckles: Speckles,
}

impl CpuExecutor {
    /// Creates an executor for pairs of this size and at least `disparities` candidates, at most 256, that removes
    /// islands of up to `island` pixels.
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

    fn disparities(&mut self, pair: [&[u8]; 2], workers: &mut ThreadPool, out: &mut [u16]) -> Result<(), GpuError> {
        let Self { width, prior, semi_global, speckles, .. } = self;
        let width = *width;
        semi_global.winners(pair, prior.likely(pair[0], workers), workers, out);
        speckles.remove(out, width, self.island, workers);
        // Before filling: filled disparities are no evidence for the next pair.
        prior.keep(pair[0], out);
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
