//! Which processor does the work: one choice for the blur and for stereo matching.

#[cfg(feature = "gpu")]
use std::sync::Arc;

use crate::bokeh::{self, Backend, Bokeh, BokehError};
#[cfg(feature = "gpu")]
use crate::compute::device::Device;
use crate::compute::thread_pool::cores;
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
    /// The GPU to blur and draw with; `None` where the CPU does.
    ///
    /// # Errors
    /// A GPU was asked for and there is none that fits.
    #[cfg(feature = "gpu")]
    pub fn device(&self) -> Result<Option<Arc<Device>>, BokehError> {
        let asked_for = self.backend == Backend::Gpu || self.adapter.is_some();
        if self.backend == Backend::Cpu {
            return Ok(None);
        }
        match Device::open(!asked_for, self.adapter.as_deref()) {
            Ok(device) => Ok(Some(Arc::new(device))),
            Err(error) if asked_for => Err(error.into()),
            Err(error) => {
                tracing::info!("blurring and drawing on the CPU: {error}");
                Ok(None)
            }
        }
    }

    /// Threads for what the CPU does.
    pub fn threads(&self) -> usize {
        self.threads.unwrap_or_else(cores)
    }

    /// An executor for pictures of `size` pixels.
    ///
    /// # Errors
    /// There is no such GPU, or the picture is larger than memory.
    pub fn blur(&self, settings: &bokeh::Settings, size: (u32, u32)) -> Result<Box<dyn Bokeh>, BokehError> {
        bokeh::create(settings, size, self.backend, self.adapter.as_deref(), self.threads)
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
    /// The GPU, if there is one; it is opened for the first executor.
    #[cfg(feature = "gpu")]
    device: Option<Option<Arc<Device>>>,
}

impl Executors {
    /// As `computing` says.
    pub fn new(computing: Computing) -> Self {
        Self {
            computing,
            #[cfg(feature = "gpu")]
            device: None,
        }
    }

    /// An executor for pictures of `size` pixels.
    ///
    /// # Errors
    /// As for [`Computing::blur`].
    pub fn blur(&mut self, settings: &bokeh::Settings, size: (u32, u32)) -> Result<Box<dyn Bokeh>, BokehError> {
        let threads = self.computing.threads;
        #[cfg(feature = "gpu")]
        {
            let device = match &self.device {
                Some(device) => device,
                None => self.device.insert(self.computing.device()?),
            };
            // A device that failed does not recover.
            if let Some(device) = device.as_ref().filter(|device| device.check().is_ok()) {
                return bokeh::create_on(settings, size, Arc::clone(device), threads);
            }
        }
        bokeh::create(settings, size, Backend::Cpu, None, threads)
    }
}
