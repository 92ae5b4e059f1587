//! How long each pass took.

use std::time::Duration;

/// Two stamps of the device for each pass.
pub struct Times {
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    back: wgpu::Buffer,
    last: Vec<Duration>,
}

impl Times {
    /// For so many passes.
    pub fn new(device: &wgpu::Device, passes: usize) -> Self {
        use wgpu::BufferUsages as Usage;
        let buffer = |label, usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: passes as u64 * 16,
                usage,
                mapped_at_creation: false,
            })
        };
        Self {
            set: device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("pass times"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * passes as u32,
            }),
            resolved: buffer("stamps", Usage::QUERY_RESOLVE | Usage::COPY_SRC),
            back: buffer("stamps back", Usage::MAP_READ | Usage::COPY_DST),
            last: vec![Duration::ZERO; passes],
        }
    }

    /// Where the pass `index` leaves its stamps.
    pub fn of_pass(&self, index: usize) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            query_set: &self.set,
            beginning_of_pass_write_index: Some(2 * index as u32),
            end_of_pass_write_index: Some(2 * index as u32 + 1),
        }
    }

    /// Fetches the stamps after the last pass.
    pub fn fetch(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.resolve_query_set(&self.set, 0..2 * self.last.len() as u32, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.back, 0, self.back.size());
    }

    /// Asks for the stamps, after the commands were submitted.
    pub fn map(&self) {
        self.back.map_async(wgpu::MapMode::Read, .., |_| {});
    }

    /// Reads the stamps, after the device is done, which are `period_ns` apart.
    pub fn read(&mut self, period_ns: f32) {
        if let Ok(bytes) = self.back.get_mapped_range(..) {
            for (last, bytes) in self.last.iter_mut().zip(bytes.as_chunks::<16>().0) {
                let stamps = u128::from_le_bytes(*bytes);
                // Stamps may run backwards when clocks change.
                let ticks = ((stamps >> 64) as u64).saturating_sub(stamps as u64);
                *last = Duration::from_nanos((ticks as f64 * f64::from(period_ns)) as u64);
            }
        }
        self.back.unmap();
    }

    /// The times of the passes over the last pair.
    pub fn last(&self) -> impl Iterator<Item = Duration> {
        self.last.iter().copied()
    }
}
