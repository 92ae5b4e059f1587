//! What finds the disparities that both eyes agree on.

use crate::compute::GpuError;
use crate::compute::thread_pool::ThreadPool;

/// Finds the disparities that both eyes agree on. All executors find the same, to the bit.
pub trait Executor: Send {
    /// One line for the report.
    fn describe(&self) -> String;

    /// Writes the disparities of the left picture to `out`, in fixed point ([`super::fixed`]), or unknown. `eyes` are
    /// the grey values of the left and the right picture, row by row. `likely` has one more than the whole disparity
    /// that is likely for a pixel, or 0: that one and those beside it cost less by [`super::fixed::BONUS`].
    ///
    /// # Errors
    /// The GPU failed.
    fn winners(
        &mut self,
        eyes: [&[u8]; 2],
        likely: Option<&[u16]>,
        workers: &mut ThreadPool,
        out: &mut [u16],
    ) -> Result<(), GpuError>;
}
