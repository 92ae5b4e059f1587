//! The blur stage: one plan, two executors.
//!
//! A [`Settings`] becomes a [`plan::Plan`] once per picture size; the CPU executor (`cpu`) and the GPU executor
//! (`gpu`) run it with the same passes under the same names.

pub mod aperture;
#[doc(hidden)]
pub mod bank;
#[doc(hidden)]
pub mod cpu;
mod error;
#[doc(hidden)]
pub mod fallback;
#[cfg(feature = "gpu")]
#[doc(hidden)]
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
pub mod rung;
#[doc(hidden)]
pub mod share;
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
use crate::compute::{Device, DeviceFrame, Place};
use crate::frame::{ColorImage, DepthMap, YuyvImage};
use crate::link::pool::Pooled;
use crate::names::named;
use crate::optics::{CocField, CocKind};

named! {
    /// How a blur that follows depth is composited.
    pub enum Method default Layered {
        /// Depth bins, blurred and composited front to back
        Layered = "layered",
        /// Every pixel gathers with its own radius: the paper's plain form
        Gather = "gather",
    }
}

/// How many separable terms approximate the aperture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rank {
    /// The first `n` terms of the singular value decomposition, 1 to 16.
    Terms(u32),
    /// Every term that the aperture's picture has.
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

/// Everything about the blur that stays the same from frame to frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// What kind of CoC frames have.
    pub coc: CocKind,
    /// Compositing where it follows depth.
    pub method: Method,
    /// Shape of the aperture.
    pub aperture: aperture::Aperture,
    /// Width of the soft rim, as a fraction of the radius, 0 to 1.
    pub rim: f32,
    /// Separable terms; `None` takes the quality level's.
    pub rank: Option<Rank>,
    /// Highlight recovery `M`: clipped white is taken as `M` times as bright; 0 switches it off.
    pub highlights: f32,
    /// Rung of the quality ladder.
    pub quality: Quality,
    /// Whether each frame may choose its own rung ([`Job::quality`]): the executor is then made for all of them.
    pub adaptive: bool,
    /// Largest CoC radius behind the focal plane, in pixels.
    pub far_max_px: f32,
    /// Largest CoC radius in front of the focal plane, in pixels (0 when nothing can be there).
    pub near_max_px: f32,
}

/// One frame to blur. The executor owns the buffers until the frame is [`Finished`].
pub struct Job {
    /// Chosen by the caller; comes back in [`Finished`].
    pub ticket: u64,
    /// The picture.
    pub color: Pooled<ColorImage>,
    /// Its depth; needed when `coc` is [`CocField::Depth`].
    pub depth: Option<Pooled<DepthMap>>,
    /// The radius of every pixel.
    pub coc: CocField,
    /// The rung of the quality ladder; ignored unless the settings are [`adaptive`](Settings::adaptive).
    pub quality: Quality,
    /// Where the result is wanted.
    pub place: Place,
    /// Buffer for the result in memory; resized to the picture's size.
    pub out: Pooled<ColorImage>,
    /// A buffer for the result as YUYV, where that is as good: an executor that makes it as easily fills this one in the
    /// place of `out`. Not for results on the device.
    pub yuyv: Option<Pooled<YuyvImage>>,
    /// The picture and its depth once more, where they are in the memory of the executor's device already, so that they need
    /// not go up.
    #[doc(hidden)]
    pub on_device: Option<Pooled<DeviceFrame>>,
}

impl Job {
    /// A frame with ticket 0, to be blurred at the default quality into memory of its own.
    pub fn new(color: Pooled<ColorImage>, depth: Option<Pooled<DepthMap>>, coc: CocField) -> Self {
        let (quality, place, out) = (Quality::default(), Place::Memory, Pooled::detached(ColorImage::default()));
        Self { ticket: 0, color, depth, coc, quality, place, out, yuyv: None, on_device: None }
    }
}

/// A blurred frame.
pub struct Finished {
    /// The job's ticket.
    pub ticket: u64,
    /// The result, at [`Job::place`]; in memory where the CPU made it, or the GPU had no picture to leave it in.
    pub picture: Picture,
    /// The job's picture.
    pub color: Pooled<ColorImage>,
    /// The job's depth.
    pub depth: Option<Pooled<DepthMap>>,
    /// Time per pass.
    pub times: PassTimes,
}

/// Which intermediate result of the last frame to read, as vectors of four values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Probe {
    /// After `bin`, per pixel of a bin: premultiplied r, g, b and coverage.
    Bin(usize),
    /// After `reach`, two vectors per row of cells and edge of a segment: radius in bin pixels and lowest r, g, b;
    /// highest r, g, b and an unused value.
    Reach(usize),
    /// After `blur`, per pixel of a bin: premultiplied r, g, b and coverage.
    Blur(usize),
}

/// The executor for pictures of `size` (width, height), on a GPU or on the CPU; `threads` is for the CPU, all cores when
/// `None`.
///
/// # Errors
/// The blur is too wide ([`Settings::check`]); the GPU is too small for such pictures, failed, or blurs otherwise than the
/// CPU. A GPU that fails later is no error: the CPU takes over.
pub fn create(
    settings: &Settings,
    size: (u32, u32),
    device: Option<Arc<Device>>,
    threads: Option<usize>,
) -> Result<Box<dyn Bokeh>, BokehError> {
    settings.check(size)?;
    let plan = plan::Plan::new(settings, size.0, size.1);
    #[cfg(feature = "gpu")]
    if let Some(device) = device {
        return gpu_with_fallback(&plan, device, threads);
    }
    #[cfg(not(feature = "gpu"))]
    let _ = device;
    Ok(Box::new(cpu::CpuBokeh::new(plan, threads)))
}

/// The executor on a GPU that blurs as the CPU does, with the CPU to take over: its buffers are allocated only when the
/// GPU fails.
#[cfg(feature = "gpu")]
fn gpu_with_fallback(
    plan: &plan::Plan,
    device: Arc<Device>,
    threads: Option<usize>,
) -> Result<Box<dyn Bokeh>, BokehError> {
    gpu::try_out(&device)?;
    let gpu = gpu::GpuBokeh::on(plan, device)?;
    let plan = plan.clone();
    let cpu = move || Box::new(cpu::CpuBokeh::new(plan, threads)) as Box<dyn Bokeh>;
    Ok(Box::new(fallback::Fallback::new(Box::new(gpu), Box::new(cpu))))
}

/// An executor of the plan.
///
/// Frames come out in the order they went in. `submit` may be called while [`Bokeh::in_flight`] is below
/// [`Bokeh::capacity`].
pub trait Bokeh: Send {
    /// Starts one frame.
    ///
    /// # Errors
    /// The frame does not fit the plan, or the device failed; it is then gone, unless [`Bokeh::take_back`] returns it.
    fn submit(&mut self, job: Job) -> Result<(), BokehError>;

    /// After an error, takes back the oldest frame in flight, or the one just refused, as it was submitted: another
    /// executor can blur it. `None` when there is no such frame (any more).
    fn take_back(&mut self) -> Option<Job> {
        None
    }

    /// The oldest finished frame, if there is one; with `wait`, blocks until there is (or nothing is in flight).
    ///
    /// # Errors
    /// The device failed.
    fn collect(&mut self, wait: bool) -> Result<Option<Finished>, BokehError>;

    /// Frames submitted and not yet collected.
    fn in_flight(&self) -> usize;

    /// Frames that may be in flight at once.
    fn capacity(&self) -> usize;

    /// What runs it: [`Backend::Gpu`] or [`Backend::Cpu`].
    fn backend(&self) -> Backend;

    /// What ran it, for the report: `cpu`, `gpu`, or `gpu, then cpu`.
    fn backends(&self) -> &'static str {
        self.backend().name()
    }

    /// The GPU that it runs on, for what else there is to do of its frames.
    fn device(&self) -> Option<Arc<Device>> {
        None
    }

    /// One line for the report, such as `cpu, 2 threads, AVX-512` or the adapter's name.
    fn describe(&self) -> String;
}
