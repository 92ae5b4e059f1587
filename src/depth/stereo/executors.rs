//! Which executor matches: one on a GPU, one on the CPU, or the second where the first fails.

#[cfg(feature = "gpu")]
use std::sync::Arc;

use super::cpu::CpuExecutor;
use super::executor::Executor;
#[cfg(feature = "gpu")]
use super::gpu::GpuExecutor;
#[cfg(feature = "gpu")]
use crate::compute::device::Device;
#[cfg(feature = "gpu")]
use crate::compute::thread_pool::ThreadPool;
use crate::compute::{Backend, GpuError};

/// Makes executors on the chosen backend.
pub(super) struct Executors {
    threads: usize,
    /// The GPU, if one is used, and whether it was asked for by name or kind, so that the CPU must not take its place.
    #[cfg(feature = "gpu")]
    gpu: Option<(Arc<Device>, bool)>,
}

impl Executors {
    /// Executors on one GPU or on the CPU, for a pool of `threads`.
    ///
    /// # Errors
    /// A GPU was asked for and there is none that fits.
    #[cfg(feature = "gpu")]
    pub fn new(backend: Backend, adapter: Option<&str>, threads: usize) -> Result<Self, GpuError> {
        if backend == Backend::Cpu {
            return Ok(Self { threads, gpu: None });
        }
        let is_required = backend == Backend::Gpu || adapter.is_some();
        match Device::open(backend == Backend::Auto, adapter) {
            Ok(device) => Ok(Self { threads, gpu: Some((Arc::new(device), is_required)) }),
            Err(error) if is_required => Err(error),
            Err(error) => {
                tracing::info!("matching on the CPU: {error}");
                Ok(Self { threads, gpu: None })
            }
        }
    }

    /// Executors on the CPU, for a pool of `threads`.
    ///
    /// # Errors
    /// A GPU was asked for.
    #[cfg(not(feature = "gpu"))]
    pub fn new(backend: Backend, adapter: Option<&str>, threads: usize) -> Result<Self, GpuError> {
        if backend == Backend::Gpu || adapter.is_some() { Err(GpuError::left_out()) } else { Ok(Self { threads }) }
    }

    /// An executor for pictures of `size` (columns, rows) and at least so many disparities, at most 256, that drops
    /// islands of up to `island` pixels.
    ///
    /// # Errors
    /// The GPU that was asked for has no room, or failed.
    pub fn executor(
        &self,
        size: (usize, usize),
        disparities: usize,
        island: u32,
    ) -> Result<Box<dyn Executor>, GpuError> {
        #[cfg(feature = "gpu")]
        if let Some((device, is_required)) = &self.gpu {
            match GpuExecutor::new(device, size, disparities, island) {
                Ok(gpu) => {
                    let threads = self.threads;
                    let cpu =
                        move || Box::new(CpuExecutor::new(size, disparities, island, threads)) as Box<dyn Executor>;
                    return Ok(Box::new(Fallback::new(Box::new(gpu), cpu)));
                }
                Err(error) if *is_required => return Err(error),
                Err(error) => tracing::info!("matching on the CPU: {error}"),
            }
        }
        Ok(Box::new(CpuExecutor::new(size, disparities, island, self.threads)))
    }
}

/// The executor on the GPU, replaced by one on the CPU at its first fault.
#[cfg(feature = "gpu")]
struct Fallback {
    now: Box<dyn Executor>,
    /// Makes the replacement; `None` once it was needed.
    other: Option<MakesExecutor>,
}

#[cfg(feature = "gpu")]
type MakesExecutor = Box<dyn FnOnce() -> Box<dyn Executor> + Send>;

#[cfg(feature = "gpu")]
impl Fallback {
    fn new(first: Box<dyn Executor>, other: impl FnOnce() -> Box<dyn Executor> + Send + 'static) -> Self {
        Self { now: first, other: Some(Box::new(other)) }
    }
}

#[cfg(feature = "gpu")]
impl Executor for Fallback {
    fn describe(&self) -> String {
        self.now.describe()
    }

    fn device(&self) -> Option<Arc<Device>> {
        self.now.device()
    }

    fn disparities(&mut self, eyes: [&[u8]; 2], workers: &mut ThreadPool, out: &mut [u16]) -> Result<(), GpuError> {
        match (self.now.disparities(eyes, workers, out), self.other.take()) {
            (Err(error), Some(other)) => {
                tracing::warn!("{error}; the CPU matches from here on");
                // This pair is matched anew, so that none is lost; what the last one made likely is gone with the GPU.
                self.now = other();
                self.now.disparities(eyes, workers, out)
            }
            (found, other) => {
                self.other = other;
                found
            }
        }
    }
}
