//! Compute passes on a device, recorded in order and timed by the device's timestamps.

use std::time::Duration;

use super::readback::Readback;
use super::{Device, Shader};
use crate::compute::{GpuError, PassTimes};

/// A pipeline with its buffers and number of workgroups.
pub struct Pass {
    name: &'static str,
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
    workgroups: [u32; 3],
}

impl Pass {
    /// Creates a pass over `buffers`, at bindings 0, 1 and so on.
    pub fn new<'a>(
        device: &Device,
        shader: Shader,
        constants: &[(&str, f64)],
        buffers: impl IntoIterator<Item = wgpu::BufferBinding<'a>>,
        workgroups: [u32; 3],
    ) -> Self {
        let pipeline = device.pipeline(shader, constants);
        let bindings = device.create_bind_group(&pipeline, buffers.into_iter());
        Self { name: shader.name, pipeline, bindings, workgroups }
    }

    /// Changes the name under which the pass is timed.
    #[must_use]
    pub fn with_name(self, name: &'static str) -> Self {
        Self { name, ..self }
    }

    /// Binds other buffers.
    pub fn rebind<'a>(&mut self, device: &Device, buffers: impl IntoIterator<Item = wgpu::BufferBinding<'a>>) {
        self.bindings = device.create_bind_group(&self.pipeline, buffers.into_iter());
    }
}

/// Records passes; each sees the writes of those before it.
pub struct Recorder<'a> {
    /// Encoder, for copies between passes.
    pub encoder: wgpu::CommandEncoder,
    stamps: Option<&'a mut Timestamps>,
}

impl<'a> Recorder<'a> {
    /// Starts recording. With `stamps`, the passes are timed.
    pub fn new(device: &Device, mut stamps: Option<&'a mut Timestamps>) -> Self {
        if let Some(stamps) = &mut stamps {
            stamps.names.clear();
        }
        let encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        Self { encoder, stamps }
    }

    /// Records a pass.
    pub fn record(&mut self, pass: &Pass) {
        self.record_workgroups(pass, pass.workgroups);
    }

    /// Records a pass with another number of workgroups.
    pub fn record_workgroups(&mut self, pass: &Pass, [x, y, z]: [u32; 3]) {
        let timestamp_writes = self.stamps.as_mut().and_then(|stamps| stamps.next_pass_writes(pass.name));
        let descriptor = wgpu::ComputePassDescriptor { label: Some(pass.name), timestamp_writes };
        let mut recorded = self.encoder.begin_compute_pass(&descriptor);
        recorded.set_pipeline(&pass.pipeline);
        recorded.set_bind_group(0, &pass.bindings, &[]);
        recorded.dispatch_workgroups(x, y, z);
    }

    /// Submits everything, waits, and calls `take` with the first `bytes` of `source`, whole words.
    ///
    /// # Errors
    /// The device failed, or took too long.
    pub fn submit_and_read<T>(
        mut self,
        device: &Device,
        readback: &mut Readback,
        source: &wgpu::Buffer,
        bytes: u64,
        take: impl FnOnce(&[u8]) -> T,
    ) -> Result<T, GpuError> {
        readback.record_copy(&mut self.encoder, source, bytes);
        let Self { encoder, mut stamps } = self;
        let submission = submit(device, encoder, stamps.as_deref_mut());
        readback.map();
        device.poll(Some(submission))?;
        // If other threads use the device, too, one of them may be about to run the callback.
        device.wait_for(|| !readback.is_pending())?;
        let taken = readback.read(device, take)?;
        if let Some(stamps) = stamps {
            stamps.last_times = stamps.read(device)?;
        }
        Ok(taken)
    }

    /// Submits everything, and requests the timestamps.
    pub fn submit(self, device: &Device) -> wgpu::SubmissionIndex {
        submit(device, self.encoder, self.stamps)
    }
}

fn submit(
    device: &Device,
    mut encoder: wgpu::CommandEncoder,
    mut stamps: Option<&mut Timestamps>,
) -> wgpu::SubmissionIndex {
    if let Some(stamps) = &mut stamps {
        stamps.resolve(&mut encoder);
    }
    let submission = device.queue.submit([encoder.finish()]);
    if let Some(stamps) = stamps {
        stamps.readback.map();
    }
    submission
}

/// Timestamps before and after each pass of a frame, and their readback.
pub struct Timestamps {
    query_set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readback: Readback,
    /// Names of the timed passes, in order; at most `capacity`.
    names: Vec<&'static str>,
    capacity: usize,
    last_times: PassTimes,
}

impl Timestamps {
    /// Creates timestamps for `capacity` passes; later ones are not timed. `None` if the device has no timestamps.
    pub fn new(device: &Device, capacity: usize) -> Option<Self> {
        use wgpu::BufferUsages as Usage;
        let query_set = || {
            device.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("pass times"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * capacity as u32,
            })
        };
        // Two stamps of 8 bytes.
        let bytes = 16 * capacity;
        device.timestamps.then(|| Self {
            query_set: query_set(),
            resolved: device.create_buffer("stamps", bytes, Usage::QUERY_RESOLVE | Usage::COPY_SRC),
            readback: Readback::new(device, "stamps back", bytes),
            names: Vec::with_capacity(capacity),
            capacity,
            last_times: PassTimes::new(),
        })
    }

    /// Returns where the next pass writes its timestamps.
    fn next_pass_writes(&mut self, name: &'static str) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let index = 2 * self.names.len() as u32;
        (self.names.len() < self.capacity).then(|| {
            self.names.push(name);
            wgpu::ComputePassTimestampWrites {
                query_set: &self.query_set,
                beginning_of_pass_write_index: Some(index),
                end_of_pass_write_index: Some(index + 1),
            }
        })
    }

    /// Copies the timestamps to a buffer that the host can read.
    fn resolve(&mut self, encoder: &mut wgpu::CommandEncoder) {
        encoder.resolve_query_set(&self.query_set, 0..2 * self.names.len() as u32, &self.resolved, 0);
        self.readback.record_copy(encoder, &self.resolved, self.resolved.size());
    }

    /// Returns the time of each pass of the last [readback](Recorder::submit_and_read).
    pub fn last_times(&self) -> PassTimes {
        self.last_times
    }

    /// Whether the timestamps are still being read back.
    pub fn are_pending(&self) -> bool {
        self.readback.is_pending()
    }

    /// Returns the time of each pass, after the readback. Empty if a timestamp pair decreases, because the device's
    /// clock then changed in between and all of them are invalid.
    ///
    /// # Errors
    /// The readback failed.
    pub fn read(&self, device: &Device) -> Result<PassTimes, GpuError> {
        let period_ns = f64::from(device.queue.get_timestamp_period());
        self.readback.read(device, |bytes| {
            let mut times = PassTimes::new();
            for (name, bytes) in self.names.iter().zip(bytes.as_chunks::<16>().0) {
                // Start in the lower half, end in the upper one.
                let stamps = u128::from_le_bytes(*bytes);
                let Some(ticks) = ((stamps >> 64) as u64).checked_sub(stamps as u64) else { return PassTimes::new() };
                times.add(name, Duration::from_nanos((ticks as f64 * period_ns) as u64));
            }
            times
        })
    }
}

/// Stride of uniforms that share a buffer, in bytes: the largest alignment that a device may require.
pub const UNIFORM_STRIDE: u64 = 256;

/// Returns the binding of uniform number `index` in a buffer.
pub fn uniform_binding<T>(buffer: &wgpu::Buffer, index: usize) -> wgpu::BufferBinding<'_> {
    let size = wgpu::BufferSize::new(size_of::<T>() as u64);
    wgpu::BufferBinding { buffer, offset: index as u64 * UNIFORM_STRIDE, size }
}

/// Returns a 2-D dispatch of at least `workgroups` workgroups: a device may limit x and y to 65,535.
pub fn workgroups_2d(workgroups: u32) -> [u32; 3] {
    let down = workgroups.div_ceil(32_768).max(1);
    [workgroups.div_ceil(down), down, 1]
}
