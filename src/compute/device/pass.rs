//! Passes on a device, in their order, and what each took by the device's own timestamps.

use std::time::Duration;

use super::readback::Readback;
use super::{Device, Shader};
use crate::compute::{GpuError, PassTimes};

/// A pipeline, its buffers, and how many workgroups it takes.
pub struct Pass {
    name: &'static str,
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
    workgroups: [u32; 3],
}

impl Pass {
    /// A pass over `buffers`, at bindings 0, 1 and so on.
    pub fn new<'a>(
        device: &Device,
        shader: Shader,
        constants: &[(&str, f64)],
        buffers: impl IntoIterator<Item = wgpu::BufferBinding<'a>>,
        workgroups: [u32; 3],
    ) -> Self {
        let pipeline = device.pipeline(shader, constants);
        let bindings = device.bindings(&pipeline, buffers.into_iter());
        Self { name: shader.name, pipeline, bindings, workgroups }
    }

    /// The same, whose time counts for another name.
    #[must_use]
    pub fn named(self, name: &'static str) -> Self {
        Self { name, ..self }
    }

    /// Takes other buffers.
    pub fn bind<'a>(&mut self, device: &Device, buffers: impl IntoIterator<Item = wgpu::BufferBinding<'a>>) {
        self.bindings = device.bindings(&self.pipeline, buffers.into_iter());
    }
}

/// Records passes, each of which sees what those before it wrote.
pub struct Recorder<'a> {
    /// For copies between passes.
    pub encoder: wgpu::CommandEncoder,
    stamps: Option<&'a mut Stamps>,
}

impl<'a> Recorder<'a> {
    /// Nothing is recorded yet. With `stamps`, the passes are timed.
    pub fn new(device: &Device, mut stamps: Option<&'a mut Stamps>) -> Self {
        if let Some(stamps) = &mut stamps {
            stamps.names.clear();
        }
        let encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        Self { encoder, stamps }
    }

    /// Records a pass.
    pub fn run(&mut self, pass: &Pass) {
        self.run_by(pass, pass.workgroups);
    }

    /// The same by another number of workgroups.
    pub fn run_by(&mut self, pass: &Pass, [x, y, z]: [u32; 3]) {
        let timestamp_writes = self.stamps.as_mut().and_then(|stamps| stamps.of_next(pass.name));
        let descriptor = wgpu::ComputePassDescriptor { label: Some(pass.name), timestamp_writes };
        let mut recorded = self.encoder.begin_compute_pass(&descriptor);
        recorded.set_pipeline(&pass.pipeline);
        recorded.set_bind_group(0, &pass.bindings, &[]);
        recorded.dispatch_workgroups(x, y, z);
    }

    /// Has the device do all of it, waits, and gives the first `bytes` of `source`, whole words, to `take`.
    ///
    /// # Errors
    /// The device failed, or took too long.
    pub fn fetch<T>(
        mut self,
        device: &Device,
        readback: &mut Readback,
        (source, bytes): (&wgpu::Buffer, u64),
        take: impl FnOnce(&[u8]) -> T,
    ) -> Result<T, GpuError> {
        readback.copy(&mut self.encoder, source, bytes);
        let Self { encoder, mut stamps } = self;
        let submission = submit(device, encoder, stamps.as_deref_mut());
        readback.map();
        device.poll(Some(submission))?;
        // Where others use the device, too, one of them may be about to run the callback.
        device.wait_for(|| !readback.is_pending())?;
        let taken = readback.read(device, take)?;
        if let Some(stamps) = stamps {
            stamps.last = stamps.read(device)?;
        }
        Ok(taken)
    }

    /// Has the device do all of it, and asks for the times.
    pub fn submit(self, device: &Device) -> wgpu::SubmissionIndex {
        submit(device, self.encoder, self.stamps)
    }
}

fn submit(
    device: &Device,
    mut encoder: wgpu::CommandEncoder,
    mut stamps: Option<&mut Stamps>,
) -> wgpu::SubmissionIndex {
    if let Some(stamps) = &mut stamps {
        stamps.fetch(&mut encoder);
    }
    let submission = device.queue.submit([encoder.finish()]);
    if let Some(stamps) = stamps {
        stamps.readback.map();
    }
    submission
}

/// Timestamps before and after each pass of a frame, and their way back.
pub struct Stamps {
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readback: Readback,
    /// The timed passes, in order; no more than there is room for.
    names: Vec<&'static str>,
    most: usize,
    last: PassTimes,
}

impl Stamps {
    /// For so many passes; those after that are not timed. `None` where the device has no timestamps.
    pub fn new(device: &Device, most: usize) -> Option<Self> {
        use wgpu::BufferUsages as Usage;
        let set = || {
            device.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("pass times"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * most as u32,
            })
        };
        // Two stamps of 8 bytes.
        let bytes = 16 * most;
        device.timestamps.then(|| Self {
            set: set(),
            resolved: device.buffer("stamps", bytes, Usage::QUERY_RESOLVE | Usage::COPY_SRC),
            readback: Readback::new(device, "stamps back", bytes),
            names: Vec::with_capacity(most),
            most,
            last: PassTimes::new(),
        })
    }

    /// Where the next pass leaves its stamps.
    fn of_next(&mut self, name: &'static str) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let index = 2 * self.names.len() as u32;
        (self.names.len() < self.most).then(|| {
            self.names.push(name);
            wgpu::ComputePassTimestampWrites {
                query_set: &self.set,
                beginning_of_pass_write_index: Some(index),
                end_of_pass_write_index: Some(index + 1),
            }
        })
    }

    /// Copies the stamps to where the host can read them.
    fn fetch(&mut self, encoder: &mut wgpu::CommandEncoder) {
        encoder.resolve_query_set(&self.set, 0..2 * self.names.len() as u32, &self.resolved, 0);
        self.readback.copy(encoder, &self.resolved, self.resolved.size());
    }

    /// The time of each pass of what was [fetched](Recorder::fetch) last.
    pub fn last(&self) -> PassTimes {
        self.last
    }

    /// Whether they are still on their way.
    pub fn are_pending(&self) -> bool {
        self.readback.is_pending()
    }

    /// The time of each pass, once they are here; of none where the device's clock changed meanwhile, as stamps that run
    /// backwards show: they say nothing.
    ///
    /// # Errors
    /// They did not come back.
    pub fn read(&self, device: &Device) -> Result<PassTimes, GpuError> {
        let period_ns = f64::from(device.queue.get_timestamp_period());
        self.readback.read(device, |bytes| {
            let mut times = PassTimes::new();
            for (name, bytes) in self.names.iter().zip(bytes.as_chunks::<16>().0) {
                // The beginning in the lower half, the end in the upper one.
                let stamps = u128::from_le_bytes(*bytes);
                let Some(ticks) = ((stamps >> 64) as u64).checked_sub(stamps as u64) else { return PassTimes::new() };
                times.add(name, Duration::from_nanos((ticks as f64 * period_ns) as u64));
            }
            times
        })
    }
}

/// Bytes from one uniform to the next in a buffer of several: no device asks for more.
pub const UNIFORM_STRIDE: u64 = 256;

/// Uniform number `index` of several in a buffer.
pub fn uniform_at<T>(buffer: &wgpu::Buffer, index: usize) -> wgpu::BufferBinding<'_> {
    let size = wgpu::BufferSize::new(size_of::<T>() as u64);
    wgpu::BufferBinding { buffer, offset: index as u64 * UNIFORM_STRIDE, size }
}

/// Workgroups in x and y, as a device may limit both to 65,535: `workgroups` in all, or a few more.
pub fn workgroups_2d(workgroups: u32) -> [u32; 3] {
    let down = workgroups.div_ceil(32_768).max(1);
    [workgroups.div_ceil(down), down, 1]
}
