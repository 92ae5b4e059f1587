//! Refines measured depth for the blur: resamples it to the picture's size, fills holes, smooths surfaces, aligns depth
//! edges with colour edges, and filters it in time.
//!
//! Misplaced edges and flicker are visible in the blur; noise on surfaces matters less. Everything is computed in
//! inverse depth, the focus distance over the depth, in which the circle of confusion is linear, planes are linear, and
//! the noise of a stereo or structured-light sensor is the same at every distance (Khoshelham and Oude Elberink,
//! *Accuracy and resolution of Kinect depth data*, 2012).

mod align;
mod band;
mod exactness;
#[doc(hidden)]
#[cfg_attr(not(feature = "gpu"), path = "no_gpu.rs")]
pub mod gpu;
mod noise;
mod outlines;
mod planes;
mod smooth;
mod temporal;
mod tiles;
mod upsample;
mod votes;

use std::sync::Arc;

use pulp::Arch;

pub use self::exactness::ExactnessDetector;
pub use self::outlines::Outlines;

use self::align::Aligner;
use self::noise::NoiseEstimator;
use self::smooth::{Smoother, invert};
use self::temporal::{Limits, TemporalFilter};
use self::upsample::Upsampler;
use super::fill::HoleFiller;
use crate::compute::thread_pool::ThreadPool;
use crate::compute::with_fallback::WithFallback;
use crate::compute::{Device, DeviceFrame};
use crate::frame::fit::Letterbox;
use crate::frame::{ColorImage, DepthMap, reset_buffer};
use crate::link::pool::Pooled;

/// Minimum depth step of an edge in inverse depth: 0.6 px of CoC at a radius of 10 px at infinity; smaller steps are
/// not visible in the blur.
const MIN_DEPTH_STEP: f32 = 0.06;
/// Minimum depth step in standard deviations of the noise that is left after smoothing.
const DEPTH_STEP_SIGMAS: f32 = 4.0;
/// Temporal changes up to this, or up to this many standard deviations of the measured noise, are averaged.
const MIN_CHANGE: f32 = 0.01;
const CHANGE_SIGMAS: f32 = 4.0;

/// Corrections of a map whose outlines are too far off for the colour-guided alignment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MapCorrection {
    /// How far all outlines are moved first, in pixels of the picture: outwards, seen from the nearer surface; inwards
    /// if negative.
    pub distance_px: i32,
    /// The downsampling factor of the coarsest scale, which is refined first and then halved down to 1. At each scale
    /// an edge moves by a few pixels, so that errors up to that many times larger are corrected.
    pub coarsest: u32,
}

impl Default for MapCorrection {
    /// No correction.
    fn default() -> Self {
        Self { distance_px: 0, coarsest: 1 }
    }
}

/// Refines the depth of consecutive frames; owns its buffers and the state of the last frame.
#[derive(Debug, Default)]
pub struct Refiner {
    arch: Arch,
    upsampler: Upsampler,
    filler: HoleFiller,
    /// Pixels whose depth was not measured, but filled in.
    unknown: Vec<bool>,
    /// Focus distance over the depth.
    inverse: Vec<f32>,
    noise_estimator: NoiseEstimator,
    smoother: Smoother,
    aligner: Aligner,
    temporal: TemporalFilter,
    focus: Focus,
    correction: MapCorrection,
    outlines: Outlines,
    /// The downsampled picture.
    reduced: ColorImage,
    fit: Letterbox,
    /// Whether no frame follows another, so that nothing is kept of them.
    single: bool,
    /// Refines instead of the CPU, until the device fails.
    gpu: WithFallback<Option<gpu::GpuRefiner>>,
}

/// The focus distance in metres. Inverse depth is this over the depth, so that equal steps of it blur equally.
#[derive(Clone, Copy, Debug)]
struct Focus(f32);

impl Default for Focus {
    fn default() -> Self {
        Self(1.0)
    }
}

impl Refiner {
    /// Creates a refiner without state of earlier frames.
    pub fn new() -> Self {
        Self::default()
    }

    /// Creates a refiner that corrects misaligned maps first.
    pub fn with_correction(correction: MapCorrection) -> Self {
        let coarsest = correction.coarsest.clamp(1, 1 << 5).next_power_of_two();
        Self { correction: MapCorrection { coarsest, ..correction }, ..Self::default() }
    }

    /// Refines single pictures if `single`, each on its own: keeps nothing of them, which saves memory.
    #[must_use]
    pub fn for_single_pictures(self, single: bool) -> Self {
        Self { single, ..self }
    }

    /// Moves refinement to `device` if it passes its self-test and maps need no correction. When it fails, the CPU
    /// takes over with the same frame.
    #[must_use]
    pub fn with_device(self, device: Option<&Arc<Device>>) -> Self {
        let device = device.filter(|_| self.correction == MapCorrection::default());
        let gpu = WithFallback::create_tested(device, "refines", gpu::run_self_test, gpu::GpuRefiner::new);
        Self { gpu, ..self }
    }

    /// Returns the backends used, for the report: `cpu`, `gpu`, or `gpu, then cpu`.
    pub fn backends(&self) -> &'static str {
        self.gpu.backends()
    }

    /// Returns the last refined map and its picture on the device; `None` if the CPU refined it. Valid until the next
    /// frame.
    pub fn device_frame(&self) -> Option<DeviceFrame> {
        self.gpu.worker().as_ref()?.device_frame()
    }

    /// Returns a copy of the last refined map and its picture on the device, once per frame.
    pub fn take_copy(&mut self) -> Option<Pooled<DeviceFrame>> {
        self.gpu.worker_mut().as_mut()?.take_copy()
    }

    /// Discards the state of earlier frames, for a new scene.
    pub fn reset(&mut self) {
        self.temporal.reset();
        self.focus = Focus::default();
        self.gpu.worker_mut().iter_mut().for_each(gpu::GpuRefiner::reset);
    }

    /// Sets the focus distance in metres from the next frame on; it scales depth steps, which count less on a street
    /// than on a desk. The default is 1 m.
    pub fn set_focus(&mut self, focus_m: f32) {
        if DepthMap::is_known(focus_m) && focus_m != self.focus.0 {
            self.temporal.rescale(focus_m / self.focus.0);
            self.focus = Focus(focus_m);
        }
    }

    /// Refines the depth `map` of the picture `color` at `time_ns` of media time, on the caller's thread; the map takes
    /// the picture's size. A frame that does not follow the last one (another size, a seek, a gap) starts anew. Without
    /// any known depth so far, the map stays unknown (0) everywhere.
    pub fn refine(&mut self, map: &mut DepthMap, color: &ColorImage, time_ns: u64) {
        self.refine_with_workers(&mut ThreadPool::new("refine", 1), map, color, time_ns);
    }

    /// Refines like [`Refiner::refine`] on several threads; the result is independent of their number, to the bit.
    pub fn refine_with_workers(
        &mut self,
        workers: &mut ThreadPool,
        map: &mut DepthMap,
        color: &ColorImage,
        time_ns: u64,
    ) {
        if self.gpu.try_run("refines", |gpu| gpu.refine(map, color, time_ns, self.focus.0)) {
            return;
        }
        let MapCorrection { mut distance_px, coarsest: mut scale } = self.correction;
        while scale > 1 {
            let size = |side: u32| side.div_ceil(scale);
            let mut reduced = std::mem::take(&mut self.reduced);
            reduced.resize(size(color.width), size(color.height));
            self.fit.fit(color, &mut reduced);
            let scaled_px = distance_px as f32 / scale as f32;
            self.refine_at_scale(workers, map, &reduced, scaled_px.round() as i32, None);
            distance_px = 0;
            self.reduced = reduced;
            scale /= 2;
        }
        self.refine_at_scale(workers, map, color, distance_px, Some(time_ns).filter(|_| !self.single));
    }

    /// Refines `map` at the size of `color`, after moving its outlines. The temporal filter runs only with a `time_ns`:
    /// at full scale, in a stream.
    fn refine_at_scale(
        &mut self,
        workers: &mut ThreadPool,
        map: &mut DepthMap,
        color: &ColorImage,
        distance_px: i32,
        time_ns: Option<u64>,
    ) {
        self.upsampler.resize(workers, map, color.size());
        self.filler.fill_guided(map, color);
        // The filler fills all holes or none: the first pixel shows which.
        if !map.metres.first().is_some_and(|&z_m| DepthMap::is_known(z_m)) {
            return self.temporal.reset();
        }
        let Self {
            arch, unknown, inverse, filler, noise_estimator, smoother, outlines, aligner, temporal, focus, ..
        } = self;
        let (arch, width, focus_m) = (*arch, map.width as usize, focus.0);
        let size = (width, map.height as usize);
        reset_buffer(unknown, map.metres.len());
        filler.holes().iter().for_each(|hole| unknown[hole.pixels(width)].fill(true));
        let measured_noise = noise_estimator.estimate(|at| focus_m / map.metres[at], |at| unknown[at], size);
        smoother.smooth((arch, workers), (&map.metres, focus_m), inverse, width, measured_noise);
        let noise = noise_estimator.estimate(|at| inverse[at], |at| unknown[at], size);
        let depth_step = MIN_DEPTH_STEP.max(DEPTH_STEP_SIGMAS * noise);
        outlines.shift(inverse, unknown, width, distance_px, depth_step);
        aligner.align((arch, workers), inverse, unknown, &color.rgb, width, depth_step);
        let Some(time_ns) = time_ns else {
            return invert((arch, workers), focus_m, (inverse, &mut map.metres), width);
        };
        let limits = Limits { noise: MIN_CHANGE.max(CHANGE_SIGMAS * measured_noise), depth_step: 2.0 * depth_step };
        temporal.filter((arch, workers), inverse, (&color.rgb, width, time_ns), limits, (&mut map.metres, focus_m));
    }
}
