//! The GPU executor of refinement: wgpu compute passes, one WGSL file each under `shaders/`. Picture and map are
//! uploaded and the refined map is read back; measurements and the temporal state stay on the device.
//!
//! Results differ from those of [`super::Refiner`] on the CPU in two cases only: a comparison with a limit may turn out
//! differently by rounding; and pixels between two surfaces are decided in parallel from their neighbours after the
//! votes, where the CPU decides them one after the other.

mod buffers;
mod passes;
mod self_test;
pub mod shaders;

use std::fmt;
use std::sync::Arc;

pub use self_test::run_self_test;

use buffers::Buffers;
use passes::Passes;
use shaders::Frame;

use super::temporal;
use crate::compute::device::{Device, DeviceFrame, Recorder, Timestamps};
use crate::compute::{GpuError, PassTimes};
use crate::depth::guided_fill;
use crate::depth::tap::Tap;
use crate::frame::{ColorImage, DepthMap};
use crate::link::pool::{Pool, Pooled};

/// Refines the depth of consecutive frames on a device; owns its buffers and the state of the last frame.
pub struct GpuRefiner {
    device: Arc<Device>,
    /// State for pictures of the last size.
    resources: Option<Resources>,
}

impl fmt::Debug for GpuRefiner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("GpuRefiner").field("device", &self.device.name).finish_non_exhaustive()
    }
}

/// Resources for pictures of one size.
struct Resources {
    size: (u32, u32),
    buffers: Buffers,
    passes: Passes,
    /// Size of the maps that the sample positions of columns and rows are for.
    map_size: (u32, u32),
    columns: Vec<Tap>,
    rows: Vec<Tap>,
    /// Time and focus distance of the frame of the temporal state.
    last: Option<(u64, f32)>,
    /// Whether the last refined map and its picture are on the device.
    is_on_device: bool,
    /// Copies of refined maps with their pictures, for the blur, and that of the last one.
    copies: Pool<DeviceFrame>,
    copy: Option<Pooled<DeviceFrame>>,
    timestamps: Option<Timestamps>,
}

/// Maximum number of copies in use; without a free one the frame is uploaded again.
const COPIES: usize = 4;

/// Upper bound for the passes of a frame.
const MAX_PASSES: usize = 80;

impl GpuRefiner {
    /// Creates a refiner on a device, without testing it.
    pub fn new(device: &Arc<Device>) -> Self {
        Self { device: Arc::clone(device), resources: None }
    }

    /// Discards the state of all frames.
    pub fn reset(&mut self) {
        if let Some(resources) = &mut self.resources {
            resources.last = None;
        }
    }

    /// Returns the time of each pass over the last frame; empty if the device has no timestamps.
    pub fn pass_times(&self) -> PassTimes {
        let timestamps = self.resources.as_ref().and_then(|resources| resources.timestamps.as_ref());
        timestamps.map(Timestamps::last_times).unwrap_or_default()
    }

    /// Returns the last refined map and its picture on the device, if they are there; valid until the next frame.
    pub fn device_frame(&self) -> Option<DeviceFrame> {
        let Resources { size, buffers: Buffers { refined, rgb, .. }, .. } =
            self.resources.as_ref().filter(|resources| resources.is_on_device)?;
        Some(DeviceFrame::from_buffers(&self.device, *size, refined, rgb))
    }

    /// Returns a copy of the last refined map and its picture, once per frame.
    pub fn take_copy(&mut self) -> Option<Pooled<DeviceFrame>> {
        self.resources.as_mut()?.copy.take()
    }

    /// Refines the depth `map` of the picture `color` at `time_ns`, with this focus distance in metres.
    ///
    /// # Errors
    /// Fails if the device fails or lacks memory; the map is then unchanged.
    pub fn refine(
        &mut self,
        map: &mut DepthMap,
        color: &ColorImage,
        time_ns: u64,
        focus_m: f32,
    ) -> Result<(), GpuError> {
        let Self { device, resources } = self;
        device.check()?;
        if resources.as_ref().is_none_or(|resources| resources.size != color.size()) {
            // Frees the old buffers before the new ones are allocated.
            *resources = None;
            *resources = Some(Resources::new(device, color.size())?);
        }
        let Some(resources) = resources else { return Ok(()) };
        resources.refine(device, map, color, time_ns, focus_m)
    }
}

impl Resources {
    fn new(device: &Arc<Device>, size: (u32, u32)) -> Result<Self, GpuError> {
        let buffers = Buffers::new(device, size)?;
        let passes = Passes::new(device, size, &buffers);
        let (map_size, columns, rows) = ((0, 0), Vec::new(), Vec::new());
        let copies = device.with_error_scope(|| Pool::new(COPIES, || DeviceFrame::new(device, size)))?;
        Ok(Self {
            size,
            buffers,
            passes,
            map_size,
            columns,
            rows,
            last: None,
            is_on_device: false,
            copies,
            copy: None,
            timestamps: Timestamps::new(device, MAX_PASSES),
        })
    }

    /// Prepares for maps of another size.
    fn set_map_size(&mut self, device: &Device, map_size: (u32, u32)) -> Result<(), GpuError> {
        let Self { size, buffers, passes, columns, rows, .. } = self;
        for (taps, to, from) in [(&mut *columns, size.0, map_size.0), (rows, size.1, map_size.1)] {
            taps.clear();
            let same = |at| Tap { first: at, second: at, weight: 0.0 };
            let tap = |at| if to == from { same(at) } else { Tap::new(at, to as usize, from as usize) };
            taps.extend((0..to as usize).map(tap));
        }
        let words: Vec<[u32; 2]> =
            columns.iter().chain(&*rows).map(|tap| [tap.first as u32, tap.weight.to_bits()]).collect();
        device.upload(&buffers.taps, 0, bytemuck::cast_slice(&words));
        let samples = map_size.0 as usize * map_size.1 as usize;
        if 4 * samples as u64 > buffers.map.size() {
            device.check_picture_size(map_size, 4 * samples as u64, "refined")?;
            buffers.map = device.with_error_scope(|| Buffers::create_map(device, samples))?;
            passes.rebind_map(device, *size, buffers);
        }
        self.map_size = map_size;
        Ok(())
    }

    /// Whether the resampled map has any known depth.
    fn has_known_depth(&self, map: &DepthMap) -> bool {
        self.rows.iter().any(|row| {
            let samples = &map.metres[row.nearest() * map.width as usize..][..map.width as usize];
            self.columns.iter().any(|column| DepthMap::is_known(samples[column.nearest()]))
        })
    }

    fn refine(
        &mut self,
        device: &Device,
        map: &mut DepthMap,
        color: &ColorImage,
        time_ns: u64,
        focus_m: f32,
    ) -> Result<(), GpuError> {
        (self.is_on_device, self.copy) = (false, None);
        if !map.metres.is_empty() && self.map_size != map.size() {
            self.set_map_size(device, map.size())?;
        }
        // Without any depth, the map is unknown everywhere, as on the CPU.
        if map.metres.is_empty() || !self.has_known_depth(map) {
            map.resize(color.width, color.height);
            map.metres.fill(0.0);
            self.last = None;
            return Ok(());
        }
        // The temporal state is in units of its own focus distance, hence the factor.
        let last = self.last.filter(|(before_ns, _)| temporal::are_consecutive(*before_ns, time_ns));
        let frame = Frame {
            size: [color.width, color.height],
            map_size: [self.map_size.0, self.map_size.1],
            focus_m,
            rescale: last.map_or(1.0, |(_, before_m)| focus_m / before_m),
            max_hole_px: guided_fill::max_hole_px(color.width as usize) as u32,
            is_fresh: last.is_none().into(),
        };
        device.upload(&self.buffers.frame, 0, bytemuck::bytes_of(&frame));
        device.upload(&self.buffers.rgb, 0, &color.rgb);
        device.upload(&self.buffers.map, 0, bytemuck::cast_slice(&map.metres));
        self.run_passes(device, map, last.is_none())?;
        self.is_on_device = true;
        self.last = Some((time_ns, focus_m));
        Ok(())
    }

    /// Runs the passes and reads the refined map back.
    fn run_passes(&mut self, device: &Device, map: &mut DepthMap, is_fresh: bool) -> Result<(), GpuError> {
        let Buffers { counts, rgb, refined, readback, .. } = &mut self.buffers;
        let mut recorder = Recorder::new(device, self.timestamps.as_mut());
        recorder.encoder.clear_buffer(counts, 0, None);
        self.passes.record(&mut recorder, is_fresh);
        let copy = self.copies.try_take();
        for (from, to) in copy.iter().flat_map(|copy| [(&*refined, &copy.metres), (rgb, &copy.rgb)]) {
            recorder.encoder.copy_buffer_to_buffer(from, 0, to, 0, from.size());
        }
        recorder.submit_and_read(device, readback, refined, refined.size(), |bytes| {
            map.resize(self.size.0, self.size.1);
            let out: &mut [u8] = bytemuck::cast_slice_mut(&mut map.metres);
            let length = out.len();
            out.copy_from_slice(&bytes[..length]);
        })?;
        self.copy = copy;
        Ok(())
    }
}
