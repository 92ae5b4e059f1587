//! Self-test of a device against the CPU, which catches driver faults before a user sees them.

use std::any::TypeId;
use std::sync::PoisonError;

use super::Device;
use crate::compute::GpuError;

/// Result of a small computation on a device, compared with the CPU's.
#[derive(Clone, Copy, Debug)]
pub struct SelfTest {
    /// Number of values that differ; `all` is their total.
    pub wrong: usize,
    pub all: usize,
    /// One in this many may differ, because of rounding.
    pub one_in: usize,
    /// Description of the values, such as `depth values`.
    pub results: &'static str,
}

impl SelfTest {
    /// Returns an error if too many values differ.
    pub fn fault(&self, device: &Device) -> Option<GpuError> {
        let (Self { wrong, all, one_in, results }, name) = (self, &device.name);
        (wrong * one_in > *all).then(|| {
            GpuError::Failed(format!(
                "{name}: self-test failed: {wrong} of {all} {results} are wrong; its driver may be faulty"
            ))
        })
    }
}

impl Device {
    /// Returns the fault that `self_test` finds in workers of type `T` on this device, if any. Runs the self-test at
    /// the first call, and again only if it could not be completed.
    ///
    /// # Errors
    /// The self-test could not be completed.
    pub fn find_fault<T: 'static, E>(
        &self,
        self_test: impl FnOnce() -> Result<Option<GpuError>, E>,
    ) -> Result<Option<GpuError>, E> {
        let known = || self.faults.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(fault) = known().get(&TypeId::of::<T>()) {
            return Ok(fault.clone());
        }
        let fault = self_test()?;
        known().insert(TypeId::of::<T>(), fault.clone());
        Ok(fault)
    }
}
