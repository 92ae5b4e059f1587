//! GPU with CPU fallback: a worker runs on a device until its first fault, and on the CPU from then on.

use std::fmt::Display;
use std::sync::Arc;

use super::GpuError;
use super::device::{Device, SelfTest};

/// A worker on a device, and the data to replace it. The first fault is logged and handled by the fallback; later ones
/// are returned to the caller. If the owner implements the CPU path itself, the worker is an `Option`, `None` after a
/// fault.
#[derive(Debug)]
pub struct WithFallback<T, S = ()> {
    worker: T,
    /// Taken at the first fault.
    fallback: Option<S>,
    /// Message of the first fault.
    failure: Option<String>,
}

impl<T, S> WithFallback<T, S> {
    /// Creates a worker with the data that its replacement is made from.
    pub fn new(worker: T, fallback: S) -> Self {
        Self { worker, fallback: Some(fallback), failure: None }
    }

    /// Returns the current worker.
    pub fn worker(&self) -> &T {
        &self.worker
    }

    pub fn worker_mut(&mut self) -> &mut T {
        &mut self.worker
    }

    /// Returns the data for the replacement, until it is used.
    pub fn fallback_mut(&mut self) -> Option<&mut S> {
        self.fallback.as_mut()
    }

    /// Returns the message of the fault; `None` before any.
    pub fn failure(&self) -> Option<&str> {
        self.failure.as_deref()
    }

    /// Handles a fault: replaces the worker by the result of `make`, called with the failed worker and the spare data.
    /// Logs that the CPU `does` the work from now on.
    ///
    /// # Errors
    /// Returns `error` if the worker was replaced before, or the error of `make`.
    pub fn fall_back<E: Display>(
        &mut self,
        error: E,
        does: &str,
        make: impl FnOnce(&mut T, S) -> Result<T, E>,
    ) -> Result<(), E> {
        let Some(fallback) = self.fallback.take() else { return Err(error) };
        tracing::warn!("{error}; the CPU {does} from now on");
        self.failure = Some(error.to_string());
        self.worker = make(&mut self.worker, fallback)?;
        Ok(())
    }

    /// Runs `work`; after a fault that is [handled](Self::fall_back), runs it again.
    ///
    /// # Errors
    /// Fails like [`Self::fall_back`], or if the work fails again.
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

impl<T> WithFallback<Option<T>> {
    /// Runs `work` if there is a worker. Returns false without a worker or after a failure: the CPU must do the work.
    pub fn try_run(&mut self, does: &str, mut work: impl FnMut(&mut T) -> Result<(), GpuError>) -> bool {
        let work = |worker: &mut Option<T>| worker.as_mut().map(&mut work).transpose();
        matches!(self.run(does, work, |_, ()| Ok(None)), Ok(Some(())))
    }

    /// Returns the backends used, for the report: `cpu`, `gpu`, or `gpu, then cpu`.
    pub fn backends(&self) -> &'static str {
        match (&self.worker, &self.failure) {
            (Some(_), _) => "gpu",
            (None, Some(_)) => "gpu, then cpu",
            (None, None) => "cpu",
        }
    }
}

impl<T: 'static> WithFallback<Option<T>> {
    /// Creates the worker with `make` on a device, if there is one and it passes the `self_test`. The self-test runs
    /// once per device, and logs its fault. There is no worker on a device that has failed, which was reported already.
    pub fn create_tested(
        device: Option<&Arc<Device>>,
        does: &str,
        self_test: fn(&Arc<Device>) -> Result<SelfTest, GpuError>,
        make: fn(&Arc<Device>) -> T,
    ) -> Self {
        let is_passed = |device: &&Arc<Device>| {
            let fault = device.find_fault::<T, GpuError>(|| {
                let fault = self_test(device).map_or_else(Some, |self_test| self_test.fault(device));
                fault.iter().for_each(|fault| tracing::warn!("{fault}; the CPU {does}"));
                Ok(fault)
            });
            matches!(fault, Ok(None))
        };
        Self::new(device.filter(|device| device.check().is_ok()).filter(is_passed).map(make), ())
    }
}

impl<T> Default for WithFallback<Option<T>> {
    fn default() -> Self {
        Self::new(None, ())
    }
}
