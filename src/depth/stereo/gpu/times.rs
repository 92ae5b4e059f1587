//! How long each pass took, by timestamp queries.

use std::time::Duration;

/// The device's timestamps at the beginning and end of each pass, and how they get back.
pub struct Times {
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    /// A copy of `resolved` that the CPU can map.
    readback: wgpu::Buffer,
    last: Vec<Duration>,
}

impl Times {
    /// For so many passes.
    pub fn new(device: &wgpu::Device, passes: usize) -> Self {
        use wgpu::BufferUsages as Usage;
        let buffer = |label, usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                // Two stamps of 8 bytes.
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
            readback: buffer("stamps back", Usage::MAP_READ | Usage::COPY_DST),
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
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.readback, 0, self.readback.size());
    }

    /// Asks for the stamps, after the commands were submitted.
    pub fn map(&self) {
        self.readback.map_async(wgpu::MapMode::Read, .., |_| {});
    }

    /// Reads the stamps, in ticks of `period_ns`, after the device is done.
    pub fn read(&mut self, period_ns: f32) {
        if let Ok(bytes) = self.readback.get_mapped_range(..) {
            for (last, bytes) in self.last.iter_mut().zip(bytes.as_chunks::<16>().0) {
                // The beginning in the lower half, the end in the upper one.
                let stamps = u128::from_le_bytes(*bytes);
                // Stamps may run backwards when clocks change.
                let ticks = ((stamps >> 64) as u64).saturating_sub(stamps as u64);
                *last = Duration::from_nanos((ticks as f64 * f64::from(period_ns)) as u64);
            }
        }
        self.readback.unmap();
    }

    /// The times of the passes over the last pair.
    pub fn last(&self) -> impl Iterator<Item = Duration> {
        self.last.iter().copied()
    }
}
