//! Device, else processor: what a device does until its first fault, and the processor from there on.

use std::fmt::Display;
#[cfg(feature = "gpu")]
use std::sync::Arc;

use super::GpuError;
#[cfg(feature = "gpu")]
use super::device::{Device, Trial};

/// A worker on a device, and what it takes to go on without it. The first fault is answered by the processor, and a line says
/// so; later ones are the caller's. Where the owner has the processor's code itself, the worker is an `Option`, and `None` then.
#[derive(Debug)]
pub struct Backed<T, S = ()> {
    worker: T,
    /// Taken at the fault.
    spare: Option<S>,
    /// The fault, once there was one.
    failure: Option<String>,
}

impl<T, S> Backed<T, S> {
    /// Works by `worker` until that fails; `spare` is what the other one is made of.
    pub fn new(worker: T, spare: S) -> Self {
        Self { worker, spare: Some(spare), failure: None }
    }

    /// What works now.
    pub fn worker(&self) -> &T {
        &self.worker
    }

    pub fn worker_mut(&mut self) -> &mut T {
        &mut self.worker
    }

    /// What the other worker is to be made of, until it is.
    pub fn spare_mut(&mut self) -> Option<&mut S> {
        self.spare.as_mut()
    }

    /// Why the device does it no more; `None` while it does.
    pub fn failure(&self) -> Option<&str> {
        self.failure.as_deref()
    }

    /// Answers a fault: `make` makes the other worker of the failed one and the spare. A line says that the CPU `does` it from
    /// here on.
    ///
    /// # Errors
    /// The other worker works already, and this is its `error`; or it could not be made.
    pub fn fall_back<E: Display>(
        &mut self,
        error: E,
        does: &str,
        make: impl FnOnce(&mut T, S) -> Result<T, E>,
    ) -> Result<(), E> {
        let Some(spare) = self.spare.take() else { return Err(error) };
        tracing::warn!("{error}; the CPU {does} from here on");
        self.failure = Some(error.to_string());
        self.worker = make(&mut self.worker, spare)?;
        Ok(())
    }

    /// Works; after a fault that is [answered](Self::fall_back), again.
    ///
    /// # Errors
    /// As there; or the work fails again.
    pub fn run<R, E: Display>(
        &mut self,
        does: &str,
        mut work: impl FnMut(&mut T) -> Result<R, E>,
        make: impl FnOnce(&mut T, S) -> Result<T, E>,
    ) -> Result<R, E> {
        match work(&mut self.worker) {
            Err(error) => self.fall_back(error, does, make).and_then(|()| work(&mut self.worker)),
            done => done,
        }
    }
}

impl<T> Backed<Option<T>> {
    /// Whether there is a worker, and it did this; where not, the processor is to do it.
    pub fn did(&mut self, does: &str, mut work: impl FnMut(&mut T) -> Result<(), GpuError>) -> bool {
        let work = |worker: &mut Option<T>| worker.as_mut().map(&mut work).transpose();
        matches!(self.run(does, work, |_, ()| Ok(None)), Ok(Some(())))
    }

    /// What did it, for the report: `cpu`, `gpu`, or `gpu, then cpu`.
    pub fn backends(&self) -> &'static str {
        match (&self.worker, &self.failure) {
            (Some(_), _) => "gpu",
            (None, Some(_)) => "gpu, then cpu",
            (None, None) => "cpu",
        }
    }
}

#[cfg(feature = "gpu")]
impl<T: 'static> Backed<Option<T>> {
    /// By the worker that `make` makes on a device, where there is one that passes the `trial` of such workers: that is held once for
    /// each device, and a fault is said then. None on a device that has failed; who had it has said so.
    pub fn tried(
        device: Option<&Arc<Device>>,
        does: &str,
        trial: fn(&Arc<Device>) -> Result<Trial, GpuError>,
        make: fn(&Arc<Device>) -> T,
    ) -> Self {
        let is_passed = |device: &&Arc<Device>| {
            let fault = device.fault_of::<T, GpuError>(|| {
                let fault = trial(device).map_or_else(Some, |trial| trial.fault(device));
                fault.iter().for_each(|fault| tracing::warn!("{fault}; the CPU {does}"));
                Ok(fault)
            });
            matches!(fault, Ok(None))
        };
        Self::new(device.filter(|device| device.check().is_ok()).filter(is_passed).map(make), ())
    }
}

impl<T> Default for Backed<Option<T>> {
    fn default() -> Self {
        Self::new(None, ())
    }
}
