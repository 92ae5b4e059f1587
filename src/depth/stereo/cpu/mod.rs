//! The CPU executor: multithreaded vector code, without allocations per pair.

mod census;
mod cost;
mod path;
mod prior;
mod semi_global;
mod speckle;
mod sweep;
mod winner;

use prior::TemporalPrior;
use semi_global::SemiGlobal;
use speckle::SpeckleFilter;

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
    /// Speckles of at most this many pixels are removed.
    max_speckle: u32,
    prior: TemporalPrior,
    semi_global: SemiGlobal,
    speckles: SpeckleFilter,
}

impl CpuExecutor {
    /// Creates an executor for pairs of this size and at least `disparities` candidates, at most 256, that removes
    /// speckles of up to `max_speckle` pixels.
    pub fn new(size: (usize, usize), disparities: usize, max_speckle: u32, threads: usize) -> Self {
        Self {
            width: size.0,
            max_speckle,
            prior: TemporalPrior::new(size.0),
            semi_global: SemiGlobal::new(size, disparities, threads),
            speckles: SpeckleFilter::new(size.0 * size.1),
        }
    }
}

impl Executor for CpuExecutor {
    fn describe(&self) -> String {
        self.semi_global.describe()
    }

    fn compute_disparities(
        &mut self,
        pair: [&[u8]; 2],
        workers: &mut ThreadPool,
        out: &mut [u16],
    ) -> Result<(), GpuError> {
        let Self { width, prior, semi_global, speckles, .. } = self;
        let width = *width;
        semi_global.match_pair(pair, prior.find_likely(pair[0], workers), workers, out);
        speckles.remove_speckles(out, width, self.max_speckle, workers);
        // Before filling: filled disparities are no evidence for the next pair.
        prior.store_pair(pair[0], out);
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
