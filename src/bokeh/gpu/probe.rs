//! What the passes leave behind, for comparing the executors pass by pass.

use super::GpuBokeh;
use crate::bokeh::{BokehError, Probe};

impl GpuBokeh {
    /// The result of a pass over the last frame, in the layout that [`Probe`] states. Waits and allocates; for tests.
    ///
    /// # Errors
    /// The device failed.
    pub fn probe(&self, probe: Probe) -> Result<Vec<[f32; 4]>, BokehError> {
        let bin = |k: usize| &self.layout.bins[k];
        let pixels = |k: usize| (u64::from(bin(k).pixels_at) * 16, u64::from(bin(k).size[0] * bin(k).size[1]) * 16);
        let (buffer, (offset, bytes)) = match probe {
            Probe::Bin(k) => (&self.buffers.source, pixels(k)),
            Probe::Reach(k) => {
                let bin = bin(k);
                (&self.buffers.edges, (u64::from(bin.edges_at) * 32, u64::from(bin.edges * bin.cells[1]) * 32))
            }
            Probe::Blur(k) => (&self.buffers.blurred, pixels(k)),
        };
        let device = &self.device.device;
        let back = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("probe"),
            size: bytes,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(buffer, offset, &back, 0, bytes);
        self.device.queue.submit([encoder.finish()]);
        back.map_async(wgpu::MapMode::Read, .., |_| {});
        let fault = |error: &dyn std::fmt::Display| BokehError::Gpu(format!("{}: {error}", self.device.name));
        device.poll(wgpu::PollType::Wait { submission_index: None, timeout: None }).map_err(|error| fault(&error))?;
        let mapped = back.get_mapped_range(..).map_err(|error| fault(&error))?;
        self.device.check()?;
        Ok(bytemuck::cast_slice(&mapped).to_vec())
    }
}
