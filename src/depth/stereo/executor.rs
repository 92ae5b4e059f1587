//! The interface of the matching kernels.

use std::sync::Arc;

use crate::compute::thread_pool::ThreadPool;
use crate::compute::{Device, GpuError};

/// Finds the disparities that pass the left-right consistency check, pair after pair. All executors agree to the bit.
pub trait Executor: Send {
    /// Describes the executor in one line for the report.
    fn describe(&self) -> String;

    /// Returns the GPU that the executor uses.
    fn device(&self) -> Option<Arc<Device>> {
        None
    }

    /// Writes the disparities of the left picture to `out`, in fixed point ([`super::fixed`]). `pair` are the grey
    /// values of the left and the right picture, row by row. Pixels that have not changed since the last pair prefer
    /// their last disparity. Speckles are removed; gaps are filled along their row and marked
    /// ([`super::fixed::FILLED`]), but pixels left of the first known one of a row stay unknown.
    ///
    /// # Errors
    /// Fails if the GPU fails.
    fn compute_disparities(
        &mut self,
        pair: [&[u8]; 2],
        workers: &mut ThreadPool,
        out: &mut [u16],
    ) -> Result<(), GpuError>;
}
