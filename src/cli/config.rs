//! Resolved, validated configuration: what the raw options mean. Nothing below the command line sees an option.

#[cfg(feature = "window")]
use std::sync::Arc;

use super::error::CliError;
use super::values::{self, DepthChoice, Effect, OrAuto};
use super::{memory, options};
use crate::bokeh::{self, Backend, Bokeh, cpu::CpuBokeh, plan::Plan};
use crate::budget::Quality;
#[cfg(feature = "window")]
use crate::compute::device::Device;
use crate::compute::team::cores;
use crate::depth::DepthError;
use crate::depth::focus::FocusRule;
use crate::depth::stereo::{self, Matcher};
use crate::look::{ApertureName, Look, Strength};
use crate::optics::Lens;

/// Resolves options for a source that has depth or not.
///
/// # Errors
/// The options do not fit each other or the source, or the aperture's picture cannot be read.
pub fn look(
    blur: &options::Blur,
    aperture: &options::Aperture,
    quality: OrAuto<Quality>,
    has_depth: bool,
) -> Result<Look, CliError> {
    let usage = |text: &str| Err(CliError::Usage(text.to_string()));
    let uses_depth = has_depth && blur.depth != DepthChoice::None;
    let effect = match blur.effect {
        Effect::None => None,
        Effect::Blur => Some(bokeh::Effect::Blur),
        Effect::TiltShift => Some(bokeh::Effect::TiltShift),
        Effect::Dof | Effect::Auto if uses_depth => Some(bokeh::Effect::Dof),
        Effect::Dof if has_depth => {
            return usage("--effect dof needs depth: leave --depth none out, or use --effect blur or tilt-shift");
        }
        Effect::Dof => {
            return usage("--effect dof needs depth, and the source has none: use --effect blur or tilt-shift");
        }
        Effect::Auto => Some(bokeh::Effect::Blur),
    };
    if blur.depth == DepthChoice::Recorded && !has_depth {
        return usage("--depth recorded: the source has no depth");
    }
    let strength = match (blur.coc_at_infinity, blur.f_number, blur.focal_length, blur.sensor_width) {
        (Some(strength), ..) => strength,
        (None, None, None, None) => Strength::Default,
        (None, Some(f_number), Some(focal_length_mm), Some(sensor_width_mm)) => {
            Strength::Lens(Lens { focal_length_mm, f_number, sensor_width_mm })
        }
        _ => return usage("a lens needs all of --f-number, --focal-length and --sensor-width"),
    };
    let focuses_by_depth = effect == Some(bokeh::Effect::Dof);
    if matches!(strength, Strength::Lens(_)) && !focuses_by_depth && !matches!(blur.focus, FocusRule::Metres(_)) {
        return usage("a lens without depth needs --focus METRES: its blur depends on the distance of focus");
    }
    Ok(Look {
        effect,
        method: blur.method.into(),
        focus: blur.focus,
        focus_range_m: blur.focus_range,
        strength,
        max_coc_px: blur.max_coc.and_then(OrAuto::chosen),
        refine: blur.refine.into(),
        tilt: blur.tilt,
        aperture: aperture.aperture.load(aperture.intensity)?,
        aperture_file: match &aperture.aperture {
            ApertureName::Image(file) => Some(file.clone()),
            _ => None,
        },
        rim: aperture.rim,
        rank: aperture.rank.and_then(OrAuto::chosen),
        highlights: aperture.highlights,
        quality: quality.chosen(),
    })
}

/// What runs the blur.
#[derive(Clone, Debug)]
pub struct Executor {
    backend: Backend,
    adapter: Option<String>,
    threads: Option<usize>,
}

impl Executor {
    /// Resolves options.
    pub fn of(computing: &options::Computing) -> Self {
        Self::new(computing.backend, computing.adapter.clone(), computing.threads)
    }

    /// An executor by its backend, part of its adapter's name, and its number of threads.
    pub fn new(backend: values::Backend, adapter: Option<String>, threads: Option<usize>) -> Self {
        let backend = match backend {
            values::Backend::Auto => Backend::Auto,
            values::Backend::Gpu => Backend::Gpu,
            values::Backend::Cpu => Backend::Cpu,
        };
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

    /// Threads of the CPU executor; all cores when `None`.
    #[cfg(feature = "window")]
    pub fn threads(&self) -> Option<usize> {
        self.threads
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
