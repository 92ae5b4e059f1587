//! Measured depth, made fit for the blur: as large as the picture, without holes, calm on surfaces, with its edges on
//! the edges of the colours, and steady in time.
//!
//! The blur shows where an edge is misplaced and where depth flickers; noise of a surface matters less. All is done in
//! inverse depth, the distance in focus over the depth, in which the circle of confusion is linear, a plane is a plane,
//! and the noise of a stereo or structured-light sensor is the same at every distance (Khoshelham and Oude Elberink,
//! *Accuracy and resolution of Kinect depth data*, 2012).

mod align;
mod exactness;
#[cfg(feature = "gpu")]
#[doc(hidden)]
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

pub use self::exactness::Exactness;
pub use self::outlines::Outlines;

use self::align::Aligner;
use self::noise::NoiseMeter;
use self::smooth::{Smoother, over};
use self::temporal::{Limits, TemporalFilter};
use self::upsample::Upsampler;
use super::fill::Filler;
#[cfg(feature = "gpu")]
use crate::compute::backed::Backed;
use crate::compute::thread_pool::ThreadPool;
use crate::compute::{Device, DeviceFrame};
use crate::frame::fit::Fit;
use crate::frame::{ColorImage, DepthMap};
use crate::link::pool::Pooled;

/// A step of inverse depth from here on is an edge: 0.6 px of CoC at a radius of 10 px at infinity; less shows no edge
/// in the blur.
const JUMP: f32 = 0.06;
/// The same in standard deviations of the noise that smoothing has left.
const JUMP_SIGMAS: f32 = 4.0;
/// Changes in time up to this, or up to this many standard deviations of the measured noise, are averaged.
const LEAST_CHANGE: f32 = 0.01;
const CHANGE_SIGMAS: f32 = 4.0;

/// What a map needs that is so far off its picture that colours alone do not find the outlines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mending {
    /// How far all outlines are moved first, in pixels of the picture: outwards, seen from the nearer surface, or inwards where
    /// that is negative.
    pub distance_px: i32,
    /// The scale at which refinement begins: one pixel for so many of the picture, each way. It is halved until it is that of
    /// the picture. At each scale an edge moves by a few pixels, so that edges are found that are so many times as far off.
    pub coarsest: u32,
}

impl Default for Mending {
    /// Of a map that fits.
    fn default() -> Self {
        Self { distance_px: 0, coarsest: 1 }
    }
}

/// Refines the depth of frame after frame; owns the memory for it, and remembers the last frame.
#[derive(Debug, Default)]
pub struct Refiner {
    arch: Arch,
    upsampler: Upsampler,
    filler: Filler,
    /// Pixels whose depth nobody measured: the filler made it up.
    unknown: Vec<bool>,
    /// Distance in focus over the depth.
    inverse: Vec<f32>,
    meter: NoiseMeter,
    smoother: Smoother,
    aligner: Aligner,
    temporal: TemporalFilter,
    focus: Focus,
    mending: Mending,
    outlines: Outlines,
    /// The picture, reduced.
    reduced: ColorImage,
    fit: Fit,
    /// Refines in the processor's place, as long as the device does not fail.
    #[cfg(feature = "gpu")]
    gpu: Backed<Option<gpu::GpuRefiner>>,
}

/// The distance in focus, in metres. Inverse depth is this over the depth, so that equal steps of it blur equally.
#[derive(Clone, Copy, Debug)]
struct Focus(f32);

impl Default for Focus {
    fn default() -> Self {
        Self(1.0)
    }
}

impl Refiner {
    /// No memory of earlier frames.
    pub fn new() -> Self {
        Self::default()
    }

    /// The same for maps that need to be mended.
    pub fn mending(mending: Mending) -> Self {
        let coarsest = mending.coarsest.clamp(1, 1 << 5).next_power_of_two();
        Self { mending: Mending { coarsest, ..mending }, ..Self::default() }
    }

    /// The same on a device, where there is one that refines as the processor does, and maps need no mending. When it fails, the
    /// processor goes on, from the frame on with which it does.
    #[must_use]
    pub fn on(self, device: Option<&Arc<Device>>) -> Self {
        #[cfg(feature = "gpu")]
        {
            let device = device.filter(|_| self.mending == Mending::default());
            Self { gpu: Backed::tried(device, "refines", gpu::trial, gpu::GpuRefiner::new), ..self }
        }
        #[cfg(not(feature = "gpu"))]
        {
            let _ = device;
            self
        }
    }

    /// What refined, for the report: `cpu`, `gpu`, or `gpu, then cpu`.
    pub fn backends(&self) -> &'static str {
        #[cfg(feature = "gpu")]
        return self.gpu.backends();
        #[cfg(not(feature = "gpu"))]
        "cpu"
    }

    /// The map that was refined last, and its picture, where a device has refined it, until it refines the next.
    pub fn on_device(&self) -> Option<DeviceFrame> {
        #[cfg(feature = "gpu")]
        return self.gpu.worker().as_ref()?.refined();
        #[cfg(not(feature = "gpu"))]
        None
    }

    /// A copy of that, which stays as it is, once for each.
    pub fn take_copy(&mut self) -> Option<Pooled<DeviceFrame>> {
        #[cfg(feature = "gpu")]
        return self.gpu.worker_mut().as_mut()?.take_copy();
        #[cfg(not(feature = "gpu"))]
        None
    }

    /// Another scene comes: nothing is left of the frames before.
    pub fn forget(&mut self) {
        self.filler = Filler::new();
        self.temporal.forget();
        self.focus = Focus::default();
        #[cfg(feature = "gpu")]
        self.gpu.worker_mut().iter_mut().for_each(gpu::GpuRefiner::forget);
    }

    /// What is in focus from the next frame on, in metres: for a street, a step of depth counts less than for a desk. A
    /// metre before the first call.
    pub fn set_focus(&mut self, focus_m: f32) {
        if DepthMap::is_known(focus_m) && focus_m != self.focus.0 {
            self.temporal.rescale(focus_m / self.focus.0);
            self.focus = Focus(focus_m);
        }
    }

    /// Refines the depth `map` of the picture `color` at `time_ns` of media time; the map takes the picture's size.
    /// A frame that does not follow the one before (another size, a seek, a gap) starts anew. Where no depth was ever
    /// known, the map stays unknown (0) everywhere.
    /// On the caller's thread, as for a few frames.
    pub fn refine(&mut self, map: &mut DepthMap, color: &ColorImage, time_ns: u64) {
        self.refine_on(&mut ThreadPool::new("refine", 1), map, color, time_ns);
    }

    /// The same on several threads: the map is the same to the bit for any number of them.
    pub fn refine_on(&mut self, workers: &mut ThreadPool, map: &mut DepthMap, color: &ColorImage, time_ns: u64) {
        #[cfg(feature = "gpu")]
        if self.gpu.did("refines", |gpu| gpu.refine(map, color, time_ns, self.focus.0)) {
            return;
        }
        let Mending { mut distance_px, coarsest: mut scale } = self.mending;
        while scale > 1 {
            let size = |side: u32| side.div_ceil(scale);
            let mut reduced = std::mem::take(&mut self.reduced);
            reduced.resize(size(color.width), size(color.height));
            self.fit.fit(color, &mut reduced);
            let of_scale = distance_px as f32 / scale as f32;
            self.refine_at(workers, map, &reduced, of_scale.round() as i32, None);
            distance_px = 0;
            self.reduced = reduced;
            scale /= 2;
        }
        self.refine_at(workers, map, color, distance_px, Some(time_ns));
    }

    /// Refines `map` at the size of `color`, its outlines moved first, and steadies it where it is that of a frame at `time_ns`:
    /// only at the picture's scale a frame is compared with earlier ones.
    fn refine_at(
        &mut self,
        workers: &mut ThreadPool,
        map: &mut DepthMap,
        color: &ColorImage,
        distance_px: i32,
        time_ns: Option<u64>,
    ) {
        self.upsampler.resize(map, color.size());
        let is_good = self.filler.fill_once(map, color);
        // The filler leaves either nothing unknown or everything: one pixel tells which.
        if !map.metres.first().is_some_and(|&z_m| DepthMap::is_known(z_m)) {
            return self.temporal.forget();
        }
        let Self { arch, unknown, inverse, filler, meter, smoother, outlines, aligner, temporal, focus, .. } = self;
        let (arch, width, focus_m) = (*arch, map.width as usize, focus.0);
        let size = (width, map.height as usize);
        unknown.clear();
        unknown.resize(map.metres.len(), false);
        filler.holes().iter().for_each(|hole| unknown[hole.of_row(width)].fill(true));
        let measured_noise = meter.noise(|at| focus_m / map.metres[at], |at| unknown[at], size);
        smoother.smooth((arch, workers), (&map.metres, focus_m), inverse, width, measured_noise);
        if is_good {
            filler.take(map);
        }
        let noise = meter.noise(|at| inverse[at], |at| unknown[at], size);
        let jump = JUMP.max(JUMP_SIGMAS * noise);
        outlines.shift(inverse, unknown, width, distance_px, jump);
        aligner.align((arch, workers), inverse, unknown, &color.rgb, width, jump);
        let Some(time_ns) = time_ns else {
            return over((arch, workers), focus_m, (inverse, &mut map.metres), width);
        };
        let limits = Limits { noise: LEAST_CHANGE.max(CHANGE_SIGMAS * measured_noise), jump: 2.0 * jump };
        temporal.steady((arch, workers), inverse, (&color.rgb, width, time_ns), limits, (&mut map.metres, focus_m));
    }
}
