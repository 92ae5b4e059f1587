//! Which executor matches: one on a GPU, one on the CPU, or the second where the first fails.

#[cfg(feature = "gpu")]
use std::sync::Arc;

use super::cpu::CpuExecutor;
use super::executor::Executor;
#[cfg(feature = "gpu")]
use super::gpu::GpuExecutor;
#[cfg(feature = "gpu")]
use crate::compute::backed::Backed;
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
                    let cpu: Makes = Box::new(move || Box::new(CpuExecutor::new(size, disparities, island, threads)));
                    return Ok(Box::new(Backed::new(Box::new(gpu) as Box<dyn Executor>, cpu)));
                }
                Err(error) if *is_required => return Err(error),
                Err(error) => tracing::info!("matching on the CPU: {error}"),
            }
        }
        Ok(Box::new(CpuExecutor::new(size, disparities, island, self.threads)))
    }
}

/// What makes the executor on the CPU.
#[cfg(feature = "gpu")]
type Makes = Box<dyn FnOnce() -> Box<dyn Executor> + Send>;

#[cfg(feature = "gpu")]
impl Executor for Backed<Box<dyn Executor>, Makes> {
    fn describe(&self) -> String {
        self.worker().describe()
    }

    fn device(&self) -> Option<Arc<Device>> {
        self.worker().device()
    }

    fn disparities(&mut self, eyes: [&[u8]; 2], workers: &mut ThreadPool, out: &mut [u16]) -> Result<(), GpuError> {
        // At the fault a pair is matched anew, so that none is lost; what the last one made likely is gone with the GPU.
        self.run("matches", |executor| executor.disparities(eyes, workers, out), |_, make| Ok(make()))
    }
}
