//! Selects the executor: one on a GPU, one on the CPU, or the CPU's when the GPU fails.

use std::sync::Arc;

use super::cpu::CpuExecutor;
use super::executor::Executor;
use super::gpu::GpuExecutor;
use crate::compute::device::Device;
use crate::compute::thread_pool::ThreadPool;
use crate::compute::with_fallback::WithFallback;
use crate::compute::{Backend, GpuError};

/// Creates executors on the chosen backend.
pub(super) struct Executors {
    threads: usize,
    /// The GPU, if one is used, and whether it was requested by name or kind, so that the CPU must not replace it.
    gpu: Option<(Arc<Device>, bool)>,
}

impl Executors {
    /// Opens a GPU or selects the CPU, for a pool of `threads`.
    ///
    /// # Errors
    /// Fails if a GPU is required and none fits.
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

    /// Creates an executor for pictures of `size` (columns, rows) and at least `disparities` candidates, at most 256,
    /// that removes speckles of up to `max_speckle` pixels.
    ///
    /// # Errors
    /// Fails if the required GPU lacks memory or fails.
    pub fn create_executor(
        &self,
        size: (usize, usize),
        disparities: usize,
        max_speckle: u32,
    ) -> Result<Box<dyn Executor>, GpuError> {
        if let Some((device, is_required)) = &self.gpu {
            match GpuExecutor::new(device, size, disparities, max_speckle) {
                Ok(gpu) => {
                    let threads = self.threads;
                    let cpu: MakeCpu =
                        Box::new(move || Box::new(CpuExecutor::new(size, disparities, max_speckle, threads)));
                    return Ok(Box::new(WithFallback::new(Box::new(gpu) as Box<dyn Executor>, cpu)));
                }
                Err(error) if *is_required => return Err(error),
                Err(error) => tracing::info!("matching on the CPU: {error}"),
            }
        }
        Ok(Box::new(CpuExecutor::new(size, disparities, max_speckle, self.threads)))
    }
}

/// Creates the executor on the CPU.
type MakeCpu = Box<dyn FnOnce() -> Box<dyn Executor> + Send>;

impl Executor for WithFallback<Box<dyn Executor>, MakeCpu> {
    fn describe(&self) -> String {
        self.worker().describe()
    }

    fn device(&self) -> Option<Arc<Device>> {
        self.worker().device()
    }

    fn compute_disparities(
        &mut self,
        pair: [&[u8]; 2],
        workers: &mut ThreadPool,
        out: &mut [u16],
    ) -> Result<(), GpuError> {
        // After a fault the CPU matches the same pair, so that none is lost; only the temporal prior is lost with the
        // GPU.
        self.run("matches", |executor| executor.compute_disparities(pair, workers, out), |_, make| Ok(make()))
    }
}
