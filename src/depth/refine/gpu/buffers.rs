//! Buffers for pictures of one size.

use super::super::align::ROUNDS;
use super::super::votes;
use super::shaders::{COUNTS, Frame, MEASURES, PROCESSED, SAMPLES, WAVES, Wave};
use crate::compute::GpuError;
use crate::compute::device::{Device, Readback, UNIFORM_STRIDE, uniform_binding};

/// Buffers of a picture; some are reused by several passes with different content.
pub struct Buffers {
    pub frame: wgpu::Buffer,
    waves: wgpu::Buffer,
    /// The map as measured; grows to the largest so far.
    pub map: wgpu::Buffer,
    /// Indices and weights of the samples for each column and row.
    pub taps: wgpu::Buffer,
    pub rgb: wgpu::Buffer,
    /// The packed picture, and the last one.
    pub colors: wgpu::Buffer,
    pub before: wgpu::Buffer,
    pub flags: wgpu::Buffer,
    /// The map without holes, kept for frames without any known depth.
    pub filled: wgpu::Buffer,
    /// Depths beside holes; then the map smoothed along rows; then the worklist of the second round; then the colour
    /// change.
    pub scratch: wgpu::Buffer,
    /// Claims along rows; then inverse depth.
    pub inverse: wgpu::Buffer,
    /// Claims along columns; then the worklist of the first round.
    pub worklist: wgpu::Buffer,
    pub votes: wgpu::Buffer,
    pub spatial_weights: wgpu::Buffer,
    pub counts: wgpu::Buffer,
    pub measures: wgpu::Buffer,
    pub samples: wgpu::Buffer,
    /// State of the temporal filter.
    pub memory: wgpu::Buffer,
    pub refined: wgpu::Buffer,
    pub readback: Readback,
}

impl Buffers {
    /// Allocates for pictures of `size` pixels.
    ///
    /// # Errors
    /// Fails if the device lacks memory.
    pub fn new(device: &Device, size: (u32, u32)) -> Result<Self, GpuError> {
        use wgpu::BufferUsages as Usage;
        let (width, height) = (size.0 as usize, size.1 as usize);
        let pixels = width * height;
        // The temporal state is the largest buffer: three numbers per pixel.
        device.check_picture_size(size, pixels as u64 * 12, "refined")?;
        let buffer = |label, bytes, usage| device.create_buffer(label, bytes, usage);
        let words = |label, count: usize| buffer(label, 4 * count, Usage::STORAGE | Usage::COPY_DST);
        let buffers = device.with_error_scope(|| Self {
            frame: buffer("refined frame", size_of::<Frame>(), Usage::UNIFORM | Usage::COPY_DST),
            waves: buffer("waves", ROUNDS * (WAVES + 1) * UNIFORM_STRIDE as usize, Usage::UNIFORM | Usage::COPY_DST),
            map: Self::create_map(device, pixels),
            taps: words("taps", 2 * (width + height)),
            rgb: buffer("rgb", 3 * pixels, Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC),
            colors: words("colors", pixels),
            before: words("colors before", pixels),
            flags: words("flags", pixels),
            filled: words("filled", pixels),
            scratch: words("lent", pixels),
            inverse: words("inverse", pixels),
            worklist: words("front", pixels),
            votes: words("votes", 2 * pixels),
            spatial_weights: words("spatial_weights", size_of::<votes::Weights>() / 4),
            counts: words("counts", COUNTS),
            measures: words("measures", MEASURES),
            samples: words("samples", SAMPLES),
            memory: words("memory", 3 * pixels),
            refined: buffer("refined", 4 * pixels, Usage::STORAGE | Usage::COPY_SRC),
            readback: Readback::new(device, "refined back", 4 * pixels),
        })?;
        device.upload(
            &buffers.spatial_weights,
            0,
            bytemuck::cast_slice(votes::compute_spatial_weights().as_flattened()),
        );
        for round in 0..ROUNDS {
            for wave in 0..=WAVES {
                let first = (1 + round * (WAVES + 2)) as u32;
                let marks = if round == 0 { PROCESSED } else { 0 };
                let uniform = Wave { first, at: first + wave as u32, marks };
                device.upload(
                    &buffers.waves,
                    wave_index(round, wave) as u64 * UNIFORM_STRIDE,
                    bytemuck::bytes_of(&uniform),
                );
            }
        }
        Ok(buffers)
    }

    /// Creates a buffer for a map of `samples` samples, in metres.
    pub fn create_map(device: &Device, samples: usize) -> wgpu::Buffer {
        device.create_buffer("measured", 4 * samples, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST)
    }

    /// Returns the uniform of a wave.
    pub fn wave_binding(&self, round: usize, wave: usize) -> wgpu::BufferBinding<'_> {
        uniform_binding::<Wave>(&self.waves, wave_index(round, wave))
    }
}

fn wave_index(round: usize, wave: usize) -> usize {
    round * (WAVES + 1) + wave
}
