//! A pass: a pipeline with its buffers.

use super::{Device, Shader};

/// A pipeline, its buffers, and how many workgroups it takes.
pub struct Pass {
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
    workgroups: [u32; 2],
}

impl Pass {
    /// Of a shader with these constants, over buffers at bindings 0, 1 and so on.
    pub fn new<'a>(
        device: &Device,
        shader: Shader,
        constants: &[(&str, f64)],
        buffers: impl Iterator<Item = wgpu::BufferBinding<'a>>,
        workgroups: [u32; 2],
    ) -> Self {
        let pipeline = device.pipeline(shader, constants);
        let bindings = device.bindings(&pipeline, buffers);
        Self { pipeline, bindings, workgroups }
    }

    /// Runs after what was encoded before.
    pub fn encode(&self, pass: &mut wgpu::ComputePass) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
        let [x, y] = self.workgroups;
        pass.dispatch_workgroups(x, y, 1);
    }
}

/// Workgroups in x and y, as a device may limit both to 65,535: `workgroups` in all, or a few more.
pub fn workgroups_2d(workgroups: u32) -> [u32; 2] {
    let down = workgroups.div_ceil(32_768).max(1);
    [workgroups.div_ceil(down), down]
}
