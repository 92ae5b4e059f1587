//! Whether a device does what the processor does: drivers have faults, and none is to be found out by whoever is looked at.

use std::any::TypeId;
use std::sync::PoisonError;

use super::Device;
use crate::compute::GpuError;

/// What came of doing something small on a device and on the processor.
#[derive(Clone, Copy, Debug)]
pub struct Trial {
    /// Results that differ, and all of them.
    pub wrong: usize,
    pub all: usize,
    /// One in so many may differ, as roundings fall either way.
    pub one_in: usize,
    /// What results they are, such as `depths of a trial`.
    pub results: &'static str,
}

impl Trial {
    /// What is wrong, where more is than may be.
    pub fn fault(&self, device: &Device) -> Option<GpuError> {
        let (Self { wrong, all, one_in, results }, name) = (self, &device.name);
        (wrong * one_in > *all).then(|| {
            GpuError::Failed(format!("{name}: {wrong} of the {all} {results} are wrong: its driver may have a fault"))
        })
    }
}

impl Device {
    /// The fault that `trial` finds in what workers of the type `T` do on this device, if any. It is held at the first call, and
    /// again only where it could not be.
    ///
    /// # Errors
    /// The trial could not be held.
    pub fn fault_of<T: 'static, E>(
        &self,
        trial: impl FnOnce() -> Result<Option<GpuError>, E>,
    ) -> Result<Option<GpuError>, E> {
        let known = || self.faults.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(fault) = known().get(&TypeId::of::<T>()) {
            return Ok(fault.clone());
        }
        let fault = trial()?;
        known().insert(TypeId::of::<T>(), fault.clone());
        Ok(fault)
    }
}
