//! What finds the disparities that both eyes agree on.

use std::sync::Arc;

use crate::compute::thread_pool::ThreadPool;
use crate::compute::{Device, GpuError};

/// Finds the disparities that both eyes agree on, pair after pair. All executors find the same, to the bit.
pub trait Executor: Send {
    /// One line for the report.
    fn describe(&self) -> String;

    /// The GPU that it runs on.
    fn device(&self) -> Option<Arc<Device>> {
        None
    }

    /// Writes the disparities of the left picture to `out`, in fixed point ([`super::fixed`]). `eyes` are the grey values
    /// of the left and the right picture, row by row. What it had in the last pair is likely for a pixel that has not
    /// changed since. Islands are dropped; gaps are filled along their row and marked ([`super::fixed::FILLED`]), but
    /// what is left of the first known pixel of a row stays unknown.
    ///
    /// # Errors
    /// The GPU failed.
    fn disparities(&mut self, eyes: [&[u8]; 2], workers: &mut ThreadPool, out: &mut [u16]) -> Result<(), GpuError>;
}
