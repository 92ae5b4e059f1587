//! What a device does in the processor's place, until it fails.

use super::GpuError;

/// A worker on a device, where there is one; it is dropped at its first fault.
#[derive(Debug)]
pub struct UntilFault<T> {
    worker: Option<T>,
    has_failed: bool,
}

impl<T> UntilFault<T> {
    pub fn new(worker: Option<T>) -> Self {
        Self { worker, has_failed: false }
    }

    /// The worker that has not failed.
    pub fn worker(&self) -> Option<&T> {
        self.worker.as_ref()
    }

    pub fn worker_mut(&mut self) -> Option<&mut T> {
        self.worker.as_mut()
    }

    /// Whether there is a worker, and it did this. Of one that fails a line says why, and that the CPU `does` it from here on.
    pub fn did(&mut self, does: &str, work: impl FnOnce(&mut T) -> Result<(), GpuError>) -> bool {
        match self.worker.as_mut().map(work) {
            None => false,
            Some(Ok(())) => true,
            Some(Err(error)) => {
                tracing::warn!("{error}; the CPU {does} from here on");
                (self.worker, self.has_failed) = (None, true);
                false
            }
        }
    }

    /// What did it, for the report: `cpu`, `gpu`, or `gpu, then cpu`.
    pub fn backends(&self) -> &'static str {
        match (&self.worker, self.has_failed) {
            (Some(_), _) => "gpu",
            (None, true) => "gpu, then cpu",
            (None, false) => "cpu",
        }
    }
}

impl<T> Default for UntilFault<T> {
    fn default() -> Self {
        Self::new(None)
    }
}
