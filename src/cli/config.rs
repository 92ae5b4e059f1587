//! Resolved, validated configuration: what the raw options mean. Nothing below the command line sees an option.

#[cfg(feature = "window")]
use std::sync::Arc;

use super::error::CliError;
use super::values::DepthChoice;
use super::{memory, options};
use crate::bokeh::{self, Backend, Bokeh, cpu::CpuBokeh, plan::Plan};
#[cfg(feature = "window")]
use crate::compute::device::Device;
use crate::compute::team::cores;
use crate::depth::DepthError;
use crate::depth::focus::FocusRule;
use crate::depth::stereo::{self, Matcher};
use crate::look::{Effect, Look, Strength};

/// The look that options ask for, whatever the source.
///
/// # Errors
/// A lens is not known by all of its numbers, or the aperture's picture cannot be read.
pub fn look(blur: &options::Blur, quality: &options::LookSettings<true>) -> Result<Look, CliError> {
    let mut patch = blur.look.0.clone();
    patch.quality = quality.0.quality;
    Ok(patch.on(&Look::default())?)
}

/// The look as far as a source with depth or without allows it.
///
/// # Errors
/// It needs depth that there is not, or a distance of focus.
pub fn look_for(look: &Look, depth: &DepthChoice, has_depth: bool) -> Result<Look, CliError> {
    let usage = |text: &str| Err(CliError::Usage(text.to_string()));
    let uses_depth = has_depth && *depth != DepthChoice::None;
    if look.effect == Effect::Dof && !uses_depth {
        return usage(match has_depth {
            true => "--effect dof needs depth: leave --depth none out, or use --effect blur or tilt-shift",
            false => "--effect dof needs depth, and the source has none: use --effect blur or tilt-shift",
        });
    }
    if *depth == DepthChoice::Recorded && !has_depth {
        return usage("--depth recorded: the source has no depth");
    }
    let look = look.for_source(uses_depth);
    let has_distance = look.effect.follows_depth() || matches!(look.focus, FocusRule::Metres(_));
    if matches!(look.strength, Strength::Lens(_)) && !has_distance {
        return usage("a lens without depth needs --focus METRES: its blur depends on the distance of focus");
    }
    Ok(look)
}

/// What runs the blur.
#[derive(Clone, Debug)]
pub struct Executor {
    /// Where it runs.
    pub backend: Backend,
    /// Part of the name of the GPU to take.
    pub adapter: Option<String>,
    /// Threads of the CPU executor; all cores when `None`.
    pub threads: Option<usize>,
}

impl Executor {
    /// Resolves options.
    pub fn of(computing: &options::Computing) -> Self {
        let options::Computing { backend, adapter, threads, .. } = computing.clone();
        Self { backend, adapter, threads }
    }

    /// The GPU to blur and draw with; `None` where the CPU does.
    ///
    /// # Errors
    /// A GPU was asked for and there is none that fits.
    #[cfg(feature = "window")]
    pub fn device(&self) -> Result<Option<Arc<Device>>, CliError> {
        let asked_for = self.backend == Backend::Gpu || self.adapter.is_some();
        if self.backend == Backend::Cpu {
            return Ok(None);
        }
        match Device::open(!asked_for, self.adapter.as_deref()) {
            Ok(device) => Ok(Some(Arc::new(device))),
            Err(error) if asked_for => Err(bokeh::BokehError::from(error).into()),
            Err(error) => {
                tracing::info!("blurring and drawing on the CPU: {error}");
                Ok(None)
            }
        }
    }

    /// An executor for pictures of `size` pixels.
    ///
    /// # Errors
    /// There is no such GPU, or the picture is larger than memory.
    pub fn create(&self, settings: &bokeh::Settings, size: (u32, u32)) -> Result<Box<dyn Bokeh>, CliError> {
        memory::check(size)?;
        Ok(bokeh::create(settings, size, self.backend, self.adapter.as_deref(), self.threads)?)
    }

    /// A matcher of pairs of `size` pixels that tries so many `disparities`.
    ///
    /// # Errors
    /// There is no such GPU.
    pub fn matcher(
        &self,
        disparities: u32,
        effort: stereo::Effort,
        size: (u32, u32),
    ) -> Result<Box<dyn Matcher>, CliError> {
        let threads = self.threads.unwrap_or_else(cores);
        let settings = stereo::Settings { size, disparities, effort, threads };
        Ok(stereo::create(&settings, self.backend, self.adapter.as_deref()).map_err(DepthError::from)?)
    }

    /// The CPU executor, which can be looked into.
    ///
    /// # Errors
    /// A GPU was asked for, the blur is too wide, or the picture is larger than memory.
    pub fn create_open(&self, settings: &bokeh::Settings, size: (u32, u32)) -> Result<CpuBokeh, CliError> {
        if self.backend == Backend::Gpu || self.adapter.is_some() {
            let text = "--debug-dir looks into the CPU executor: leave --backend gpu and --adapter out";
            return Err(CliError::Usage(text.to_string()));
        }
        memory::check(size)?;
        settings.check(size)?;
        Ok(CpuBokeh::new(Plan::new(settings, size.0, size.1), self.threads))
    }
}

#[cfg(test)]
mod tests;
