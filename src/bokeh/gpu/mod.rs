//! The GPU executor.

use super::plan::Plan;
use super::{Bokeh, BokehError, Finished, Job};

/// Runs a plan with wgpu compute passes.
pub struct GpuBokeh;

impl GpuBokeh {
    /// An executor of `plan`.
    ///
    /// # Errors
    /// No adapter fits.
    pub fn new(_plan: &Plan, _hardware_only: bool, adapter: Option<&str>) -> Result<Self, BokehError> {
        Err(BokehError::NoAdapter { wanted: adapter.unwrap_or("at all").to_owned(), found: "none".to_owned() })
    }
}

impl Bokeh for GpuBokeh {
    fn submit(&mut self, _job: Job) -> Result<(), BokehError> {
        Ok(())
    }
    fn collect(&mut self, _wait: bool) -> Result<Option<Finished>, BokehError> {
        Ok(None)
    }
    fn in_flight(&self) -> usize {
        0
    }
    fn capacity(&self) -> usize {
        1
    }
    fn describe(&self) -> String {
        String::new()
    }
}
