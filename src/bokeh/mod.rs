//! The blur stage: one plan, two executors.
//!
//! A [`Settings`] becomes a [`plan::Plan`] once per picture size; the CPU executor (`cpu`) and the GPU executor
//! (`gpu`) run it with the same passes under the same names.

pub mod aperture;
#[doc(hidden)]
pub mod bank;
#[doc(hidden)]
pub mod bin_weight;
#[doc(hidden)]
pub mod cpu;
mod error;
#[doc(hidden)]
pub mod fallback;
#[doc(hidden)]
#[cfg_attr(not(feature = "gpu"), path = "no_gpu.rs")]
pub mod gpu;
#[doc(hidden)]
pub mod ladder;
mod limit;
pub mod low_rank;
mod occlusion;
mod picture;
#[doc(hidden)]
pub mod plan;
#[doc(hidden)]
pub mod quality_level;
pub mod slices;
#[doc(hidden)]
pub mod split;

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use crate::budget::Quality;
pub use error::BokehError;
pub use picture::Picture;

pub use crate::compute::{Backend, PassTimes};
use crate::compute::{Device, DeviceFrame, PictureLocation};
use crate::frame::{ColorImage, DepthMap, YuyvImage};
use crate::link::pool::Pooled;
use crate::names::named;
use crate::optics::{CocField, CocKind};

named! {
    /// How a blur that follows depth is composited.
    pub enum Method default Layered {
        /// Depth bins, blurred and composited front to back
        Layered = "layered",
        /// Every pixel gathers with its own radius: the basic method of the paper
        Gather = "gather",
    }
}

/// How many separable terms approximate the aperture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rank {
    /// The first `n` terms of the singular value decomposition, 1 to 16.
    Terms(u32),
    /// All terms of the aperture.
    Full,
}

impl FromStr for Rank {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse() {
            _ if text == "full" => Ok(Rank::Full),
            Ok(terms @ 1..=16) => Ok(Rank::Terms(terms)),
            _ => Err("use 1 to 16, or full".to_string()),
        }
    }
}

impl fmt::Display for Rank {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Rank::Terms(terms) => write!(f, "{terms}"),
            Rank::Full => f.write_str("full"),
        }
    }
}

/// Settings of the blur that stay the same from frame to frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Kind of CoC field of all frames.
    pub coc: CocKind,
    /// Compositing method if the blur follows depth.
    pub method: Method,
    /// Shape of the aperture.
    pub aperture: aperture::Aperture,
    /// Width of the soft rim, as a fraction of the radius, 0 to 1.
    pub rim: f32,
    /// Number of separable terms; `None` uses that of the quality level.
    pub rank: Option<Rank>,
    /// Highlight recovery `M`: clipped white counts as `M` times as bright; 0 switches it off.
    pub highlights: f32,
    /// Quality level of the blur.
    pub quality: Quality,
    /// True if each frame may choose its own quality level ([`Job::quality`]): the executor then allocates for all
    /// levels.
    pub adaptive: bool,
    /// Whether what is behind is steadied: noise is averaged over frames. These must then be those of one stream, in
    /// order.
    pub reuse: bool,
    /// Whether nothing behind the focal plane is represented finer than cells of half its radius, so that no filter can
    /// undo its blur.
    pub privacy: bool,
    /// Largest CoC radius behind the focal plane, in pixels.
    pub far_max_px: f32,
    /// Largest CoC radius in front of the focal plane, in pixels; 0 if nothing can be there.
    pub near_max_px: f32,
}

/// One frame to blur. The executor owns the buffers until it returns the [`BlurredFrame`].
pub struct Job {
    /// Chosen by the caller; returned in [`BlurredFrame`].
    pub ticket: u64,
    /// Picture to blur.
    pub color: Pooled<ColorImage>,
    /// Depth map of the picture; needed if `coc` is [`CocField::Depth`].
    pub depth: Option<Pooled<DepthMap>>,
    /// CoC radius of every pixel.
    pub coc: CocField,
    /// Quality level; ignored unless the settings are [`adaptive`](Settings::adaptive).
    pub quality: Quality,
    /// Where the result is needed.
    pub place: PictureLocation,
    /// Buffer for the result in memory; resized to the picture's size.
    pub out: Pooled<ColorImage>,
    /// YUYV buffer for the result, if the caller accepts YUYV: an executor that produces YUYV at no extra cost fills
    /// this buffer instead of `out`. Not for results on the device.
    pub yuyv: Option<Pooled<YuyvImage>>,
    /// The picture and its depth in the memory of the executor's device, if they are there already; saves the upload.
    #[doc(hidden)]
    pub on_device: Option<Pooled<DeviceFrame>>,
}

impl Job {
    /// Creates a job with ticket 0 and the default quality, whose result goes to a buffer of its own in memory.
    pub fn new(color: Pooled<ColorImage>, depth: Option<Pooled<DepthMap>>, coc: CocField) -> Self {
        let (quality, place, out) =
            (Quality::default(), PictureLocation::Memory, Pooled::detached(ColorImage::default()));
        Self { ticket: 0, color, depth, coc, quality, place, out, yuyv: None, on_device: None }
    }
}

/// A blurred frame.
pub struct BlurredFrame {
    /// Ticket of the job.
    pub ticket: u64,
    /// Result, at [`Job::place`]; in memory if the CPU made it or the GPU had no free picture.
    pub picture: Picture,
    /// Picture of the job.
    pub color: Pooled<ColorImage>,
    /// Depth map of the job.
    pub depth: Option<Pooled<DepthMap>>,
    /// Time per pass.
    pub times: PassTimes,
}

/// Selects an intermediate result of the last frame, read as vectors of four values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Probe {
    /// After `bin` and `decimate`, per pixel of a bin: premultiplied r, g, b and coverage.
    Bin(usize),
    /// After `reach`, two vectors per row of cells and segment edge: radius in bin pixels and lowest r, g, b; highest
    /// r, g, b and an unused value.
    Reach(usize),
    /// After `blur`, per pixel of a bin: premultiplied r, g, b and coverage.
    Blur(usize),
}

/// Creates an executor for pictures of `size` (width, height) on a GPU or on the CPU. `threads` is for the CPU; `None`
/// uses all cores.
///
/// # Errors
/// The blur is too wide ([`Settings::check`]); the GPU is too small for these pictures, failed, or its results differ
/// from those of the CPU. A later GPU failure is no error: the CPU takes over.
pub fn create_blur(
    settings: &Settings,
    size: (u32, u32),
    device: Option<Arc<Device>>,
    threads: Option<usize>,
) -> Result<Box<dyn Bokeh>, BokehError> {
    settings.check(size)?;
    let plan = plan::Plan::new(settings, size.0, size.1);
    let Some(device) = device else { return Ok(Box::new(cpu::BandedBokeh::new(plan, threads))) };
    gpu::run_self_test(&device)?;
    let gpu = gpu::GpuBokeh::with_device(&plan, device)?;
    // Allocates its buffers only when the GPU fails.
    let cpu = move || -> Box<dyn Bokeh> { Box::new(cpu::BandedBokeh::new(plan, threads)) };
    Ok(Box::new(fallback::Fallback::new(Box::new(gpu), Box::new(cpu))))
}

/// Executes a plan.
///
/// Frames come out in the order they went in. `submit` may be called while [`Bokeh::in_flight`] is below
/// [`Bokeh::capacity`].
pub trait Bokeh: Send {
    /// Starts one frame.
    ///
    /// # Errors
    /// The frame does not fit the plan, or the device failed. The frame is then lost, unless [`Bokeh::reclaim_job`]
    /// returns it.
    fn submit(&mut self, job: Job) -> Result<(), BokehError>;

    /// After an error, returns the oldest frame in flight, or the frame just refused, as it was submitted, so that
    /// another executor can blur it. Returns `None` if no frame is left.
    fn reclaim_job(&mut self) -> Option<Job> {
        None
    }

    /// Returns the oldest finished frame, if any. With `wait`, blocks until one is finished or nothing is in flight.
    ///
    /// # Errors
    /// The device failed.
    fn collect(&mut self, wait: bool) -> Result<Option<BlurredFrame>, BokehError>;

    /// Returns the number of frames submitted and not yet collected.
    fn in_flight(&self) -> usize;

    /// Returns the largest number of frames in flight.
    fn capacity(&self) -> usize;

    /// Returns the backend that runs it: [`Backend::Gpu`] or [`Backend::Cpu`].
    fn backend(&self) -> Backend;

    /// Returns the backends used so far, for the report: `cpu`, `gpu`, or `gpu, then cpu`.
    fn backends(&self) -> &'static str {
        self.backend().name()
    }

    /// Returns the GPU it runs on, so that later stages can process its results there.
    fn device(&self) -> Option<Arc<Device>> {
        None
    }

    /// Describes the executor in one line for the report, such as `cpu, 2 threads, AVX-512` or the adapter's name.
    fn describe(&self) -> String;
}
