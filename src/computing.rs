//! Which processor does the work: one choice for the blur and for stereo matching.

use std::sync::Arc;

use crate::bokeh::{self, Backend, Bokeh, BokehError};
use crate::compute::thread_pool::cores;
use crate::compute::{Device, GpuError};
use crate::depth::DepthError;
use crate::depth::stereo::{self, Matcher};

/// What blurs and matches: backend, GPU and threads, as they were chosen.
#[derive(Clone, Debug, Default)]
pub struct Computing {
    /// Where it runs.
    pub backend: Backend,
    /// Part of the name of the GPU to take.
    pub adapter: Option<String>,
    /// Threads of the CPU executor, and of those that finish depth; all cores when `None`.
    pub threads: Option<usize>,
}

impl Computing {
    /// Threads for what the CPU does.
    pub fn threads(&self) -> usize {
        self.threads.unwrap_or_else(cores)
    }

    /// An executor for pictures of `size` pixels.
    ///
    /// # Errors
    /// There is no such GPU, or the picture is larger than memory.
    pub fn blur(&self, settings: &bokeh::Settings, size: (u32, u32)) -> Result<Box<dyn Bokeh>, BokehError> {
        Executors::new(self.clone()).blur(settings, size)
    }

    /// A stereo matcher for pairs of `size` pixels that tries so many `disparities`.
    ///
    /// # Errors
    /// There is no such GPU.
    pub fn matcher(
        &self,
        disparities: u32,
        effort: stereo::Effort,
        size: (u32, u32),
    ) -> Result<Box<dyn Matcher>, DepthError> {
        let settings = stereo::Settings { size, disparities, effort, threads: self.threads() };
        Ok(stereo::create(&settings, self.backend, self.adapter.as_deref())?)
    }
}

/// Makes one executor after the other, on one device.
pub struct Executors {
    computing: Computing,
    /// The GPU, if there is one; it is opened when it is first asked for.
    device: Option<Option<Arc<Device>>>,
}

impl Executors {
    /// As `computing` says.
    pub fn new(computing: Computing) -> Self {
        Self { computing, device: None }
    }

    /// Whether it has to be a GPU.
    fn needs_gpu(&self) -> bool {
        let Computing { backend, adapter, .. } = &self.computing;
        *backend == Backend::Gpu || (*backend == Backend::Auto && adapter.is_some())
    }

    /// The GPU to blur and draw with; `None` where the CPU does.
    ///
    /// # Errors
    /// A GPU was asked for and there is none that fits.
    #[doc(hidden)]
    pub fn device(&mut self) -> Result<Option<Arc<Device>>, BokehError> {
        if let Some(device) = &self.device {
            return Ok(device.clone());
        }
        let open = || Device::open(!self.needs_gpu(), self.computing.adapter.as_deref());
        let device = match (self.computing.backend != Backend::Cpu).then(open).transpose() {
            Ok(device) => device.map(Arc::new),
            Err(error) if self.needs_gpu() => return Err(error.into()),
            Err(error) => {
                match error {
                    GpuError::NoAdapter { .. } => tracing::info!("the CPU does all: {error}"),
                    GpuError::Failed(_) => tracing::warn!("the CPU does all: {error}"),
                }
                None
            }
        };
        Ok(self.device.insert(device).clone())
    }

    /// An executor for pictures of `size` pixels.
    ///
    /// # Errors
    /// As for [`Computing::blur`].
    pub fn blur(&mut self, settings: &bokeh::Settings, size: (u32, u32)) -> Result<Box<dyn Bokeh>, BokehError> {
        let threads = self.computing.threads;
        // A device that failed does not recover.
        if let Some(device) = self.device()?.filter(|device| device.check().is_ok()) {
            match bokeh::create(settings, size, Some(device), threads) {
                Err(BokehError::Gpu(error)) if !self.needs_gpu() => {
                    tracing::warn!("blurring on the CPU: {error}");
                    self.device = Some(None);
                }
                made => return made,
            }
        }
        bokeh::create(settings, size, None, threads)
    }
}
