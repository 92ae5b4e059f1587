//! Read access to intermediate results, for comparing the executors pass by pass.

use super::GpuBokeh;
use super::shaders::{LIST_HEAD, RESULT_TILE};
use crate::bokeh::plan::CELL;
use crate::bokeh::{BokehError, Probe};
use crate::compute::device::{Readback, Recorder};

impl GpuBokeh {
    /// Returns the result of a pass over the last frame, in the layout of [`Probe`]. Waits and allocates; for tests.
    ///
    /// # Errors
    /// The device failed.
    pub fn probe(&self, probe: Probe) -> Result<Vec<[f32; 4]>, BokehError> {
        let b = &self.buffers;
        match probe {
            Probe::Reach(k) => {
                let bin = &self.layout.bins[k];
                let values = self.read_words(&b.edges, bin.edges_at * 8, bin.edges * bin.cells[1] * 8)?;
                Ok(values.as_chunks::<4>().0.iter().map(|value| value.map(f32::from_bits)).collect())
            }
            // Cells and tiles without content were not written, and have values of earlier frames.
            Probe::Bin(k) => {
                let bin = &self.layout.bins[k];
                let cells = self.read_words(&b.grid, bin.cells_at * 8, bin.cells[0] * bin.cells[1] * 8)?;
                let covered = |x: usize, y: usize| cells[(y / CELL * bin.cells[0] as usize + x / CELL) * 8] != 0;
                self.read_pixels(k, &b.source, covered)
            }
            Probe::Blur(k) => {
                let bin = &self.layout.bins[k];
                let across = bin.size[0].div_ceil(RESULT_TILE[0] as u32);
                let tiles = self.read_words(
                    &b.active,
                    LIST_HEAD as u32 + bin.active_at,
                    across * bin.size[1].div_ceil(RESULT_TILE[1] as u32),
                )?;
                let active = |x: usize, y: usize| tiles[y / RESULT_TILE[1] * across as usize + x / RESULT_TILE[0]] != 0;
                self.read_pixels(k, &b.blurred, active)
            }
        }
    }

    /// Returns the pixels of bin `k` in `buffer`, zero where they were not written.
    fn read_pixels(
        &self,
        k: usize,
        buffer: &wgpu::Buffer,
        is_written: impl Fn(usize, usize) -> bool,
    ) -> Result<Vec<[f32; 4]>, BokehError> {
        let bin = &self.layout.bins[k];
        let words = self.read_words(buffer, bin.pixels_at * 2, bin.size[0] * bin.size[1] * 2)?;
        let width = bin.size[0] as usize;
        let value = |(n, [a, b]): (usize, &[u32; 2])| {
            let halves = [*a as u16, (a >> 16) as u16, *b as u16, (b >> 16) as u16];
            if is_written(n % width, n / width) { halves.map(half_to_f32) } else { [0.0; 4] }
        };
        Ok(words.as_chunks::<2>().0.iter().enumerate().map(value).collect())
    }

    /// Reads back `count` words of a buffer, from word `first` on; waits for the device.
    fn read_words(&self, buffer: &wgpu::Buffer, first: u32, count: u32) -> Result<Vec<u32>, BokehError> {
        let (device, bytes) = (&self.device, u64::from(count) * 4);
        let part =
            device.create_buffer("probe", bytes as usize, wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST);
        let mut readback = Readback::new(device, "probe back", bytes as usize);
        let mut recorder = Recorder::new(device, None);
        recorder.encoder.copy_buffer_to_buffer(buffer, u64::from(first) * 4, &part, 0, bytes);
        Ok(recorder.submit_and_read(device, &mut readback, &part, bytes, bytemuck::pod_collect_to_vec)?)
    }
}

/// Converts half to single precision: shifts the bits, then multiplies by 2^112 for the different exponent bias. Exact
/// for subnormals, too; infinities become large numbers.
fn half_to_f32(bits: u16) -> f32 {
    let magnitude = f32::from_bits(u32::from(bits & 0x7fff) << 13) * f32::from_bits(0x7780_0000);
    if bits & 0x8000 != 0 { -magnitude } else { magnitude }
}

#[cfg(test)]
mod tests {
    use super::half_to_f32;

    #[test]
    fn half_precision() {
        for (bits, value) in [(0x3c00, 1.0), (0xc000, -2.0), (0x3555, 0.333_251_95), (0x0001, 5.960_464_5e-8), (0, 0.0)]
        {
            assert_eq!(half_to_f32(bits), value);
        }
    }
}
