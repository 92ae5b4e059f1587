//! The GPU executor of refinement: what [`super::Refiner`] does on the processor, as wgpu compute passes, one WGSL file each
//! under `shaders/`. The picture and its map go up, the refined map comes down; nothing is read back in between, as what is
//! measured stays on the device. So does what is remembered of earlier frames.
//!
//! It does what the processor does but for two things. Whether a number is above a limit may fall either way where rounding
//! decides it. And pixels that are left between two surfaces decide by their neighbours as the votes have left them, where
//! the processor lets them decide one after the other.

mod buffers;
mod passes;
pub mod shaders;
mod trial;

use std::fmt;
use std::sync::Arc;

pub use trial::trial;

use buffers::Buffers;
use passes::Passes;
use shaders::Frame;

use super::temporal;
use crate::compute::device::{Device, DeviceFrame, Recorder, Stamps};
use crate::compute::{GpuError, PassTimes};
use crate::depth::guided_fill;
use crate::depth::tap::Tap;
use crate::frame::{ColorImage, DepthMap};
use crate::link::pool::{Pool, Pooled};

/// Refines the depth of frame after frame on a device; owns the memory for it, and remembers the last frame.
pub struct GpuRefiner {
    device: Arc<Device>,
    /// For pictures of the last one's size.
    work: Option<Work>,
}

impl fmt::Debug for GpuRefiner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("GpuRefiner").field("device", &self.device.name).finish_non_exhaustive()
    }
}

/// What pictures of one size take.
struct Work {
    size: (u32, u32),
    buffers: Buffers,
    passes: Passes,
    /// Where the samples of columns and rows are, in a map of this size.
    from: (u32, u32),
    columns: Vec<Tap>,
    rows: Vec<Tap>,
    /// Whether a map without holes is on the device.
    has_filled: bool,
    /// What is remembered is of a frame at this time, with this distance in focus.
    last: Option<(u64, f32)>,
    /// Whether the last refined map, and its picture, are on the device.
    is_there: bool,
    /// Copies of refined maps with their pictures, for the blur, and that of the last one.
    copies: Pool<DeviceFrame>,
    copy: Option<Pooled<DeviceFrame>>,
    stamps: Option<Stamps>,
}

/// Copies that may be on their way at once; when all are, frames go up again.
const COPIES: usize = 4;

/// More passes than a frame has.
const MOST_PASSES: usize = 48;

impl GpuRefiner {
    /// On a device, whether it does it right or not.
    pub fn new(device: &Arc<Device>) -> Self {
        Self { device: Arc::clone(device), work: None }
    }

    /// Forgets all frames.
    pub fn forget(&mut self) {
        if let Some(work) = &mut self.work {
            (work.has_filled, work.last) = (false, None);
        }
    }

    /// The time of each pass over the last frame; of none where the device has no timestamps.
    pub fn pass_times(&self) -> PassTimes {
        self.work.as_ref().and_then(|work| work.stamps.as_ref()).map(Stamps::last).unwrap_or_default()
    }

    /// The map that was refined last, and its picture, where they are on the device, until the next one is.
    pub fn refined(&self) -> Option<DeviceFrame> {
        let Work { size, buffers: Buffers { refined, rgb, .. }, .. } =
            self.work.as_ref().filter(|work| work.is_there)?;
        Some(DeviceFrame::of(&self.device, *size, refined, rgb))
    }

    /// A copy of that, once for each.
    pub fn take_copy(&mut self) -> Option<Pooled<DeviceFrame>> {
        self.work.as_mut()?.copy.take()
    }

    /// Refines the depth `map` of the picture `color` at `time_ns`, with this distance in focus.
    ///
    /// # Errors
    /// The device failed, or has no room; the map is as it was.
    pub fn refine(
        &mut self,
        map: &mut DepthMap,
        color: &ColorImage,
        time_ns: u64,
        focus_m: f32,
    ) -> Result<(), GpuError> {
        let Self { device, work } = self;
        device.check()?;
        if work.as_ref().is_none_or(|work| work.size != color.size()) {
            // The memory of before is free before that for the new size is taken.
            *work = None;
            *work = Some(Work::new(device, color.size())?);
        }
        let Some(work) = work else { return Ok(()) };
        work.refine(device, map, color, time_ns, focus_m)
    }
}

impl Work {
    fn new(device: &Arc<Device>, size: (u32, u32)) -> Result<Self, GpuError> {
        let buffers = Buffers::new(device, size)?;
        let passes = Passes::new(device, size, &buffers);
        let (from, columns, rows) = ((0, 0), Vec::new(), Vec::new());
        let copies = device.attempt(|| Pool::new(COPIES, || DeviceFrame::new(device, size)))?;
        Ok(Self {
            size,
            buffers,
            passes,
            from,
            columns,
            rows,
            has_filled: false,
            last: None,
            is_there: false,
            copies,
            copy: None,
            stamps: Stamps::new(device, MOST_PASSES),
        })
    }

    /// Takes maps of another size.
    fn take_maps(&mut self, device: &Device, from: (u32, u32)) -> Result<(), GpuError> {
        let Self { size, buffers, passes, columns, rows, .. } = self;
        for (taps, to, from) in [(&mut *columns, size.0, from.0), (rows, size.1, from.1)] {
            taps.clear();
            let same = |at| Tap { first: at, second: at, share: 0.0 };
            let tap = |at| if to == from { same(at) } else { Tap::new(at, to as usize, from as usize) };
            taps.extend((0..to as usize).map(tap));
        }
        let words: Vec<[u32; 2]> =
            columns.iter().chain(&*rows).map(|tap| [tap.first as u32, tap.share.to_bits()]).collect();
        device.upload(&buffers.taps, 0, bytemuck::cast_slice(&words));
        let samples = from.0 as usize * from.1 as usize;
        if 4 * samples as u64 > buffers.map.size() {
            device.has_room(from, 4 * samples as u64, "refined")?;
            buffers.map = device.attempt(|| Buffers::map(device, samples))?;
            passes.set_map(device, *size, buffers);
        }
        self.from = from;
        Ok(())
    }

    /// Whether anything is known of a map, once it has the picture's size.
    fn knows_any(&self, map: &DepthMap) -> bool {
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
        (self.is_there, self.copy) = (false, None);
        if !map.metres.is_empty() && self.from != map.size() {
            self.take_maps(device, map.size())?;
        }
        let is_empty = map.metres.is_empty() || !self.knows_any(map);
        if is_empty && !self.has_filled {
            map.resize(color.width, color.height);
            map.metres.fill(0.0);
            self.last = None;
            return Ok(());
        }
        let last = self.last.filter(|(before_ns, _)| temporal::follows(*before_ns, time_ns));
        let frame = Frame {
            size: [color.width, color.height],
            map_size: [self.from.0, self.from.1],
            focus_m,
            times: last.map_or(1.0, |(_, before_m)| focus_m / before_m),
            longest: guided_fill::longest(color.width as usize) as u32,
            empty: is_empty.into(),
            fresh: last.is_none().into(),
            ..Frame::default()
        };
        device.upload(&self.buffers.frame, 0, bytemuck::bytes_of(&frame));
        device.upload(&self.buffers.rgb, 0, &color.rgb);
        if !is_empty {
            device.upload(&self.buffers.map, 0, bytemuck::cast_slice(&map.metres));
        }
        self.run(device, map, is_empty, last.is_none())?;
        (self.has_filled, self.is_there) = (true, true);
        self.last = Some((time_ns, focus_m));
        Ok(())
    }

    /// Runs the passes, and takes the refined map.
    fn run(&mut self, device: &Device, map: &mut DepthMap, is_empty: bool, is_fresh: bool) -> Result<(), GpuError> {
        let Buffers { counts, rgb, refined, readback, .. } = &mut self.buffers;
        let mut recorder = Recorder::new(device, self.stamps.as_mut());
        recorder.encoder.clear_buffer(counts, 0, None);
        self.passes.record(&mut recorder, is_empty, is_fresh);
        let copy = self.copies.try_take();
        for (from, to) in copy.iter().flat_map(|copy| [(&*refined, &copy.metres), (rgb, &copy.rgb)]) {
            recorder.encoder.copy_buffer_to_buffer(from, 0, to, 0, from.size());
        }
        recorder.fetch(device, readback, (refined, refined.size()), |bytes| {
            map.resize(self.size.0, self.size.1);
            let out: &mut [u8] = bytemuck::cast_slice_mut(&mut map.metres);
            let length = out.len();
            out.copy_from_slice(&bytes[..length]);
        })?;
        self.copy = copy;
        Ok(())
    }
}
