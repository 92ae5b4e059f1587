//! The GPU executor: wgpu compute passes, one WGSL file each under `shaders/`. It finds what the CPU executor finds,
//! to the bit.
//!
//! Costs and sums are bytes, four disparities a word, in volumes on the device: their traffic is little beside the
//! steps of the paths, which wait for each other. So each path is a workgroup of its own with four disparities in each
//! invocation, and what lies ahead is fetched while it goes.

pub mod shaders;
mod times;

use std::sync::Arc;
use std::time::Duration;

use times::Times;

use super::executor::Executor;
use super::fixed;
use super::penalty::Penalties;
use crate::compute::GpuError;
use crate::compute::device::{Device, Shader, workgroups_2d};
use crate::compute::thread_pool::ThreadPool;

/// What a workgroup does, as the shaders declare it: pixels a side of `stereo_census`, columns of `stereo_cost`, and
/// pixels of `stereo_winners`.
const TILE: usize = 16;
const STRIP: usize = 16;
const LINE: usize = 64;

/// Matches pairs of one size on a GPU.
pub struct GpuExecutor {
    device: Arc<Device>,
    pixels: usize,
    /// Grey values, left and right; the right ones begin at a multiple of 4 bytes, as uploads must.
    luma: wgpu::Buffer,
    /// One more than the disparity that is likely, or 0.
    likely: wgpu::Buffer,
    passes: [Pass; 6],
    winners: wgpu::Buffer,
    /// A copy of the winners that the CPU can map.
    readback: wgpu::Buffer,
    times: Option<Times>,
}

/// A pipeline, its buffers, and how many workgroups it takes.
struct Pass {
    name: &'static str,
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
    workgroups: [u32; 3],
}

impl GpuExecutor {
    /// For pairs of this size (columns, rows), and at least as many disparities, at most 256.
    ///
    /// # Errors
    /// The device has no room for that, or failed.
    pub fn new(device: &Arc<Device>, size: (usize, usize), disparities: usize) -> Result<Self, GpuError> {
        let ((width, height), disparities) = (size, fixed::range(disparities));
        let pixels = width * height;
        has_room(device, size, disparities)?;

        use wgpu::BufferUsages as Usage;
        let buffer = |label, bytes: usize, usage| {
            device.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                // A binding must not be empty.
                size: bytes.max(16).next_multiple_of(4) as u64,
                usage,
                mapped_at_creation: false,
            })
        };
        let luma = buffer("luma", 2 * pixels.next_multiple_of(4), Usage::STORAGE | Usage::COPY_DST);
        let table = buffer("P2", 256, Usage::STORAGE | Usage::COPY_DST);
        device.queue.write_buffer(&table, 0, Penalties::new().table());
        let likely = buffer("likely", pixels * 2, Usage::STORAGE | Usage::COPY_DST);
        let census = buffer("census", 2 * pixels * 4, Usage::STORAGE);
        let penalties = buffer("penalties", pixels * 4, Usage::STORAGE);
        let [costs, sums, totals] =
            ["costs", "sums", "totals"].map(|label| buffer(label, pixels * disparities, Usage::STORAGE));
        let winners = buffer("winners", pixels * 2, Usage::STORAGE | Usage::COPY_SRC);
        let readback = buffer("winners back", pixels * 2, Usage::MAP_READ | Usage::COPY_DST);

        let pass = |shader: Shader, from_right, buffers: &[&wgpu::Buffer], workgroups: [usize; 3]| {
            let pipeline = device.pipeline(shader, &shaders::constants(size, disparities, from_right));
            let bindings = device.bindings(&pipeline, buffers.iter().map(|buffer| buffer.as_entire_buffer_binding()));
            Pass { name: shader.name, pipeline, bindings, workgroups: workgroups.map(|count| count as u32) }
        };
        let along_rows = |from_right| pass(shaders::ROWS, from_right, &[&costs, &penalties, &sums], [height, 1, 1]);
        let [across, down] = workgroups_2d(pixels.div_ceil(LINE) as u32);
        let passes = [
            pass(
                shaders::CENSUS,
                false,
                &[&luma, &table, &census, &penalties],
                [width.div_ceil(TILE), height.div_ceil(TILE), 2],
            ),
            pass(shaders::COST, false, &[&census, &likely, &costs], [width.div_ceil(STRIP), height, 1]),
            along_rows(false),
            along_rows(true),
            pass(shaders::COLUMNS, false, &[&costs, &penalties, &sums, &totals], [width, 1, 1]),
            pass(shaders::WINNERS, false, &[&totals, &winners], [across as usize, down as usize, 1]),
        ];
        let times = device.timestamps.then(|| Times::new(&device.device, passes.len()));
        device.check()?;
        Ok(Self { device: Arc::clone(device), pixels, luma, likely, passes, winners, readback, times })
    }

    /// Name and time of each pass over the last pair, in their order; empty where the device has no timestamps.
    pub fn pass_times(&self) -> impl Iterator<Item = (&'static str, Duration)> {
        let times = self.times.iter().flat_map(|times| times.last());
        self.passes.iter().map(|pass| pass.name).zip(times)
    }
}

/// Refuses sizes whose volume of costs, or whose number of workgroups (one for each row or column), exceeds the limits
/// of the device.
fn has_room(device: &Device, (width, height): (usize, usize), disparities: usize) -> Result<(), GpuError> {
    let limits = device.device.limits();
    let bytes = (width * height * disparities) as u64;
    let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    let longest = limits.max_compute_workgroups_per_dimension as usize;
    let name = &device.name;
    if bytes > most {
        return Err(GpuError::Failed(format!(
            "{name}: {disparities} disparities of {width} x {height} pixels need buffers of {bytes} bytes and it \
             allows {most}; use --backend cpu"
        )));
    }
    if width.max(height) > longest {
        return Err(GpuError::Failed(format!(
            "{name}: pictures of {width} x {height} need {} workgroups and it allows {longest}; use --backend cpu",
            width.max(height)
        )));
    }
    Ok(())
}

impl Executor for GpuExecutor {
    fn describe(&self) -> String {
        self.device.name.clone()
    }

    fn winners(
        &mut self,
        [left, right]: [&[u8]; 2],
        likely: Option<&[u16]>,
        _: &mut ThreadPool,
        out: &mut [u16],
    ) -> Result<(), GpuError> {
        let Self { device, .. } = &*self;
        device.check()?;
        device.upload(&self.luma, 0, left);
        device.upload(&self.luma, self.pixels.next_multiple_of(4) as u64, right);

        let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        match likely {
            Some(likely) => device.upload(&self.likely, 0, bytemuck::cast_slice(likely)),
            None => encoder.clear_buffer(&self.likely, 0, None),
        }
        for (k, step) in self.passes.iter().enumerate() {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(step.name),
                timestamp_writes: self.times.as_ref().map(|times| times.of_pass(k)),
            });
            pass.set_pipeline(&step.pipeline);
            pass.set_bind_group(0, &step.bindings, &[]);
            let [x, y, z] = step.workgroups;
            pass.dispatch_workgroups(x, y, z);
        }
        encoder.copy_buffer_to_buffer(&self.winners, 0, &self.readback, 0, self.readback.size());
        if let Some(times) = &self.times {
            times.fetch(&mut encoder);
        }
        let submission = device.queue.submit([encoder.finish()]);
        // Takes effect once the submission is done, which `poll` waits for.
        self.readback.map_async(wgpu::MapMode::Read, .., |_| {});
        if let Some(times) = &self.times {
            times.map();
        }
        let fault = |error: &dyn std::fmt::Display| GpuError::Failed(format!("{}: {error}", device.name));
        device.poll(Some(submission))?;
        {
            let bytes = self.readback.get_mapped_range(..).map_err(|error| fault(&error))?;
            for (out, bytes) in out.iter_mut().zip(bytes.as_chunks().0) {
                *out = u16::from_le_bytes(*bytes);
            }
        }
        self.readback.unmap();
        if let Some(times) = &mut self.times {
            times.read(self.device.queue.get_timestamp_period());
        }
        Ok(())
    }
}
