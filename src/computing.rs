//! Choice of the processor: one setting for the blur and for stereo matching.

use std::sync::Arc;

use crate::bokeh::{self, Backend, Bokeh, BokehError};
use crate::compute::thread_pool::core_count;
use crate::compute::{Device, GpuError};
use crate::depth::DepthError;
use crate::depth::stereo::{self, Matcher};

/// Backend, GPU and threads for blur and stereo matching.
#[derive(Clone, Debug, Default)]
pub struct ComputeOptions {
    /// Backend to use.
    pub backend: Backend,
    /// Part of the name of the GPU to use.
    pub adapter: Option<String>,
    /// Threads of the CPU executor and of depth post-processing; all cores when `None`.
    pub threads: Option<usize>,
}

impl ComputeOptions {
    /// Returns the number of CPU threads.
    pub fn thread_count(&self) -> usize {
        self.threads.unwrap_or_else(core_count)
    }

    /// Creates an executor for pictures of `size` pixels.
    ///
    /// # Errors
    /// The requested GPU is missing, or the picture needs more memory than is free.
    pub fn create_blur(&self, settings: &bokeh::Settings, size: (u32, u32)) -> Result<Box<dyn Bokeh>, BokehError> {
        ExecutorFactory::new(self.clone()).create_blur(settings, size)
    }

    /// Creates a stereo matcher for pairs of `size` pixels with `disparities` disparities.
    ///
    /// # Errors
    /// The requested GPU is missing.
    pub fn create_matcher(
        &self,
        disparities: u32,
        effort: stereo::Effort,
        size: (u32, u32),
    ) -> Result<Box<dyn Matcher>, DepthError> {
        let settings = stereo::Settings { size, disparities, effort, threads: self.thread_count() };
        Ok(stereo::create(&settings, self.backend, self.adapter.as_deref())?)
    }
}

/// Creates executors one after the other on the same device.
pub struct ExecutorFactory {
    computing: ComputeOptions,
    /// The GPU, if there is one; opened at the first use.
    device: Option<Option<Arc<Device>>>,
}

impl ExecutorFactory {
    /// Creates executors with these settings.
    pub fn new(computing: ComputeOptions) -> Self {
        Self { computing, device: None }
    }

    /// Whether a GPU is required.
    fn needs_gpu(&self) -> bool {
        let ComputeOptions { backend, adapter, .. } = &self.computing;
        *backend == Backend::Gpu || (*backend == Backend::Auto && adapter.is_some())
    }

    /// Returns the GPU to blur and draw with; `None` if the CPU does both.
    ///
    /// # Errors
    /// A GPU is required and none fits.
    #[doc(hidden)]
    pub fn open_device(&mut self) -> Result<Option<Arc<Device>>, BokehError> {
        if let Some(device) = &self.device {
            return Ok(device.clone());
        }
        let open = || Device::open(!self.needs_gpu(), self.computing.adapter.as_deref());
        let device = match (self.computing.backend != Backend::Cpu).then(open).transpose() {
            Ok(device) => device.map(Arc::new),
            Err(error) if self.needs_gpu() => return Err(error.into()),
            Err(error) => {
                match error {
                    GpuError::NoAdapter { .. } => tracing::info!("everything runs on the CPU: {error}"),
                    GpuError::Failed(_) => tracing::warn!("everything runs on the CPU: {error}"),
                }
                None
            }
        };
        Ok(self.device.insert(device).clone())
    }

    /// Creates an executor for pictures of `size` pixels.
    ///
    /// # Errors
    /// Fails like [`ComputeOptions::create_blur`].
    pub fn create_blur(&mut self, settings: &bokeh::Settings, size: (u32, u32)) -> Result<Box<dyn Bokeh>, BokehError> {
        let threads = self.computing.threads;
        // A device that failed does not recover.
        if let Some(device) = self.open_device()?.filter(|device| device.check().is_ok()) {
            match bokeh::create_blur(settings, size, Some(device), threads) {
                Err(BokehError::Gpu(error)) if !self.needs_gpu() => {
                    tracing::warn!("blurring on the CPU: {error}");
                    self.device = Some(None);
                }
                made => return made,
            }
        }
        bokeh::create_blur(settings, size, None, threads)
    }
}
