//! A pass: a pipeline with its buffers.

use super::shaders::Constants;
use super::times::Times;
use crate::compute::device::{Device, Shader, workgroups_2d};

/// Pixels, or words, of a workgroup, as `stereo_line.wgsl` declares it.
const LINE: usize = 64;

/// A pipeline, its buffers, and how many workgroups it takes.
pub struct Pass {
    pub name: &'static str,
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
    workgroups: [u32; 3],
}

impl Pass {
    /// A pass over `buffers`, at bindings 0, 1 and so on.
    pub fn new(
        device: &Device,
        shader: Shader,
        constants: &Constants,
        buffers: &[&wgpu::Buffer],
        workgroups: [usize; 3],
    ) -> Self {
        let pipeline = device.pipeline(shader, constants);
        let bindings = device.bindings(&pipeline, buffers.iter().map(|buffer| buffer.as_entire_buffer_binding()));
        Self { name: shader.name, pipeline, bindings, workgroups: workgroups.map(|count| count as u32) }
    }

    /// Runs it after what was recorded before, and leaves its stamps as the pass `index` of `times`.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, times: Option<&Times>, index: usize) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(self.name),
            timestamp_writes: times.map(|times| times.of_pass(index)),
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
        let [x, y, z] = self.workgroups;
        pass.dispatch_workgroups(x, y, z);
    }
}

/// The workgroups of a pass that goes through so many pixels or words in one line.
pub fn in_line(count: usize) -> [usize; 3] {
    let [across, down] = workgroups_2d(count.div_ceil(LINE) as u32);
    [across as usize, down as usize, 1]
}
