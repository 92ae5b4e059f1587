//! The GPU executor of matting: what [`super::Matting`] does on the processor, as wgpu compute passes, one WGSL file each under
//! `shaders/`. The map and its picture go up, or are copied where they are, on the device that has refined the map; the mixed
//! pixels come down, as many as there are; nothing is read back in between. What is remembered to lie behind goes up when it has
//! changed.
//!
//! It does what the processor does but for two things. Whether a number is above a limit may fall either way where rounding decides
//! it. And of several pixels that trace the same one in a step, the first in the picture counts, where the processor has the
//! first that was traced.

mod buffers;
mod passes;
pub mod shaders;
mod trial;

use std::fmt;
use std::sync::Arc;

pub use trial::trial;

use buffers::{Buffers, Extent, known_at};
use passes::Passes;
use shaders::Frame;

use super::Behind;
use crate::color::light_of_codes;
use crate::compute::device::{Device, DeviceFrame, Recorder, Stamps};
use crate::compute::{GpuError, PassTimes};
use crate::frame::{ColorImage, DepthMap, MixedPixel};

/// Finds the mattes of frame after frame on a device; owns the memory for it.
pub struct GpuMatting {
    device: Arc<Device>,
    /// As the shaders read it: for each code its light, and that of what is remembered, by channel.
    lights: Box<[[f32; 4]; 256]>,
    /// For pictures of the last one's size.
    work: Option<Work>,
}

impl fmt::Debug for GpuMatting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("GpuMatting").field("device", &self.device.name).finish_non_exhaustive()
    }
}

/// What pictures of one size take.
struct Work {
    size: (u32, u32),
    buffers: Buffers,
    passes: Passes,
    /// What is remembered, on the device.
    revision: Option<u64>,
    /// So many mixed pixels are fetched at once: some more than the last frame had.
    expected: usize,
    stamps: Option<Stamps>,
}

/// More passes than a frame has.
const MOST_PASSES: usize = 64;

impl GpuMatting {
    /// On a device, whether it does it right or not.
    pub fn new(device: &Arc<Device>) -> Self {
        let of_codes = light_of_codes();
        let lights = Box::new(std::array::from_fn(|code| [of_codes[code], 0.0, 0.0, 0.0]));
        Self { device: Arc::clone(device), lights, work: None }
    }

    /// The time of each pass over the last frame; of none where the device has no timestamps.
    pub fn pass_times(&self) -> PassTimes {
        self.work.as_ref().and_then(|work| work.stamps.as_ref()).map(Stamps::last).unwrap_or_default()
    }

    /// Finds the mixed pixels of a map as large as its picture, as [`super::Matting::find_before`] does. What is `on_device` is
    /// that map and picture; where another device has them, they go up. How many edges there are; with more than
    /// [`Matte::most`], none of them was looked at.
    ///
    /// # Errors
    /// The device failed, or has no room; the map has no mixed pixels.
    pub fn find(
        &mut self,
        (map, color): (&mut DepthMap, &ColorImage),
        on_device: Option<DeviceFrame>,
        jump: f32,
        behind: Option<&Behind>,
    ) -> Result<usize, GpuError> {
        let Self { device, lights, work } = self;
        device.check()?;
        if work.as_ref().is_none_or(|work| work.size != map.size()) {
            // The memory of before is free before that for the new size is taken.
            *work = None;
            *work = Some(Work::new(device, map.size())?);
        }
        let Some(work) = work else { return Ok(0) };
        if let Some(behind) = behind {
            for (code, lights) in lights.iter_mut().enumerate() {
                (0..3).for_each(|p| lights[1 + p] = behind.light[p][code]);
            }
        }
        device.upload(&work.buffers.lights, 0, bytemuck::cast_slice(&**lights));
        work.find(device, (map, color, on_device.filter(|frame| frame.is_on(device))), jump, behind)
    }
}

impl Work {
    fn new(device: &Arc<Device>, size: (u32, u32)) -> Result<Self, GpuError> {
        let buffers = Buffers::new(device, size)?;
        let passes = Passes::new(device, size, &buffers);
        let stamps = Stamps::new(device, MOST_PASSES);
        Ok(Self { size, buffers, passes, revision: None, expected: 0, stamps })
    }

    fn find(
        &mut self,
        device: &Device,
        (map, color, on_device): (&mut DepthMap, &ColorImage, Option<DeviceFrame>),
        jump: f32,
        behind: Option<&Behind>,
    ) -> Result<usize, GpuError> {
        let (b, Extent { pixels, most, .. }) = (&self.buffers, Extent::new(self.size));
        let (known, other) = behind.map_or((0, 0.0), |behind| (behind.known.into(), behind.other));
        let frame = Frame { size: [self.size.0, self.size.1], most: most as u32, known, jump, other };
        device.upload(&b.frame, 0, bytemuck::bytes_of(&frame));
        if let Some(behind) = behind.filter(|behind| self.revision != Some(behind.revision)) {
            let [rgb, rounds, inverse] = known_at(pixels);
            device.upload(&b.known, rgb, behind.rgb);
            device.upload(&b.known, rounds, behind.rounds);
            device.upload(&b.known, inverse, bytemuck::cast_slice(behind.inverse));
            self.revision = Some(behind.revision);
        }
        let mut recorder = Recorder::new(device, self.stamps.as_mut());
        let is_whole = |frame: &DeviceFrame| (frame.metres.size(), frame.rgb.size()) == (b.metres.size(), b.rgb.size());
        if let Some(frame) = on_device.filter(is_whole) {
            for (from, to) in [(&frame.metres, &b.metres), (&frame.rgb, &b.rgb)] {
                recorder.encoder.copy_buffer_to_buffer(from, 0, to, 0, to.size());
            }
        } else {
            device.upload(&b.metres, 0, bytemuck::cast_slice(&map.metres));
            device.upload(&b.rgb, 0, &color.rgb);
        }
        [&b.counts, &b.cells, &b.places, &b.marks]
            .iter()
            .for_each(|buffer| recorder.encoder.clear_buffer(buffer, 0, None));
        self.passes.record(&mut recorder);
        let [found, edges] = fetch(&mut self.buffers, device, recorder, map, self.expected.min(most))?;
        if found > map.matte.pixels.len() {
            fetch(&mut self.buffers, device, Recorder::new(device, None), map, found)?;
        }
        self.expected = found + found / 4 + 256;
        Ok(edges)
    }
}

/// Takes the mixed pixels, up to so many, once what is recorded has run; how many there are, and how many edges.
fn fetch(
    b: &mut Buffers,
    device: &Device,
    recorder: Recorder,
    map: &mut DepthMap,
    most: usize,
) -> Result<[usize; 2], GpuError> {
    const EACH: usize = size_of::<MixedPixel>();
    recorder.fetch(device, &mut b.readback, (&b.mixed, ((1 + most) * EACH) as u64), |bytes| {
        // Their number is where one more would be.
        let (head, bytes) = bytes.split_at(EACH);
        let [found, edges] =
            [0, 4].map(|at| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]) as usize);
        let pixels = &mut map.matte.pixels;
        pixels.resize(found.min(most), MixedPixel::default());
        let out: &mut [u8] = bytemuck::cast_slice_mut(pixels);
        let length = out.len();
        out.copy_from_slice(&bytes[..length]);
        [found, edges]
    })
}
