//! GPU implementation of matting: the algorithm of [`super::Matting`] as wgpu compute passes, one WGSL file each under
//! `shaders/`. The map and its picture are uploaded, or copied on the device if it has refined the map; the mixed
//! pixels are read back, and nothing in between. The remembered background is uploaded when it has changed.
//!
//! It differs from the CPU where rounding decides a comparison with a threshold, which may then go either way.

mod buffers;
mod passes;
mod self_test;
pub mod shaders;

use std::fmt;
use std::sync::Arc;

pub use self_test::run_self_test;

use buffers::{Buffers, Extent, background_offsets};
use passes::Passes;
use shaders::Frame;

use super::{KnownBackground, Revision};
use crate::color::srgb_to_linear_table;
use crate::compute::device::{Device, DeviceFrame, Recorder, Timestamps};
use crate::compute::{GpuError, PassTimes};
use crate::frame::{ColorImage, DepthMap, MixedPixel};

/// Finds the mattes of frame after frame on a GPU; owns the memory for it.
pub struct GpuMatting {
    device: Arc<Device>,
    /// In the shaders' layout: per code its linear light, and that of a remembered code in each channel.
    lights: Box<[[f32; 4]; 256]>,
    /// Resources for the last picture size.
    resources: Option<Resources>,
}

impl fmt::Debug for GpuMatting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("GpuMatting").field("device", &self.device.name).finish_non_exhaustive()
    }
}

/// GPU resources for one picture size.
struct Resources {
    size: (u32, u32),
    buffers: Buffers,
    passes: Passes,
    /// Revision of the remembered background on the device.
    revision: Option<Revision>,
    /// Number of mixed pixels to read back at once: somewhat more than in the last frame.
    expected: usize,
    timestamps: Option<Timestamps>,
}

/// Upper bound of the passes per frame.
const MAX_PASSES: usize = 64;

impl GpuMatting {
    /// Creates it for a device, without a self-test.
    pub fn new(device: &Arc<Device>) -> Self {
        let of_codes = srgb_to_linear_table();
        let lights = Box::new(std::array::from_fn(|code| [of_codes[code], 0.0, 0.0, 0.0]));
        Self { device: Arc::clone(device), lights, resources: None }
    }

    /// Returns the time of each pass over the last frame; empty if the device has no timestamps.
    pub fn pass_times(&self) -> PassTimes {
        let timestamps = self.resources.as_ref().and_then(|resources| resources.timestamps.as_ref());
        timestamps.map(Timestamps::last_times).unwrap_or_default()
    }

    /// Finds the mixed pixels of a map as large as its picture, as [`super::Matting::find_with_background`] does.
    /// `device_frame` has the map and the picture already; they are uploaded if it is on another device. Returns the number
    /// of edge pixels found; of more than [`Matte::max_edges`], some were dropped.
    ///
    /// # Errors
    /// The device failed or has too little memory; the map then has no mixed pixels.
    pub fn find_mixed_pixels(
        &mut self,
        (map, color): (&mut DepthMap, &ColorImage),
        device_frame: Option<DeviceFrame>,
        depth_step: f32,
        background: Option<&KnownBackground>,
    ) -> Result<usize, GpuError> {
        let Self { device, lights, resources } = self;
        device.check()?;
        if resources.as_ref().is_none_or(|resources| resources.size != map.size()) {
            // Free the old buffers before allocating the new ones.
            *resources = None;
            *resources = Some(Resources::new(device, map.size())?);
        }
        let Some(resources) = resources else { return Ok(0) };
        if let Some(background) = background {
            for (code, lights) in lights.iter_mut().enumerate() {
                (0..3).for_each(|p| lights[1 + p] = background.light[p][code]);
            }
        }
        device.upload(&resources.buffers.lights, 0, bytemuck::cast_slice(&**lights));
        resources.find_mixed_pixels(
            device,
            (map, color, device_frame.filter(|frame| frame.is_on(device))),
            depth_step,
            background,
        )
    }
}

impl Resources {
    fn new(device: &Arc<Device>, size: (u32, u32)) -> Result<Self, GpuError> {
        let buffers = Buffers::new(device, size)?;
        let passes = Passes::new(device, size, &buffers);
        let timestamps = Timestamps::new(device, MAX_PASSES);
        Ok(Self { size, buffers, passes, revision: None, expected: 0, timestamps })
    }

    fn find_mixed_pixels(
        &mut self,
        device: &Device,
        (map, color, device_frame): (&mut DepthMap, &ColorImage, Option<DeviceFrame>),
        depth_step: f32,
        background: Option<&KnownBackground>,
    ) -> Result<usize, GpuError> {
        let (b, Extent { pixels, max_entries, .. }) = (&self.buffers, Extent::new(self.size));
        let (min_rounds, surface_step) =
            background.map_or((0, 0.0), |background| (background.min_rounds.into(), background.surface_step));
        let frame = Frame {
            size: [self.size.0, self.size.1],
            max_entries: max_entries as u32,
            min_rounds,
            depth_step,
            surface_step,
        };
        device.upload(&b.frame, 0, bytemuck::bytes_of(&frame));
        if let Some(background) = background {
            let [rgb, rounds, inverse] = background_offsets(pixels);
            let before = self.revision.replace(background.revision);
            if before.map(|before| before.picture) != Some(background.revision.picture) {
                device.upload(&b.background, rgb, background.rgb);
                device.upload(&b.background, inverse, bytemuck::cast_slice(background.inverse));
            }
            if before.map(|before| before.rounds) != Some(background.revision.rounds) {
                device.upload(&b.background, rounds, background.rounds);
            }
        }
        let mut recorder = Recorder::new(device, self.timestamps.as_mut());
        let is_whole = |frame: &DeviceFrame| (frame.metres.size(), frame.rgb.size()) == (b.metres.size(), b.rgb.size());
        if let Some(frame) = device_frame.filter(is_whole) {
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
        let [found, edges] =
            read_mixed_pixels(&mut self.buffers, device, recorder, map, self.expected.min(max_entries))?;
        if found > map.matte.pixels.len() {
            read_mixed_pixels(&mut self.buffers, device, Recorder::new(device, None), map, found)?;
        }
        self.expected = found + found / 4 + 256;
        Ok(edges)
    }
}

/// Runs the recorded passes and reads back at most `most` mixed pixels. Returns the numbers of mixed and of edge
/// pixels.
fn read_mixed_pixels(
    b: &mut Buffers,
    device: &Device,
    recorder: Recorder,
    map: &mut DepthMap,
    most: usize,
) -> Result<[usize; 2], GpuError> {
    const EACH: usize = size_of::<MixedPixel>();
    recorder.submit_and_read(device, &mut b.readback, &b.mixed, ((1 + most) * EACH) as u64, |bytes| {
        // The first record has the counts.
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
