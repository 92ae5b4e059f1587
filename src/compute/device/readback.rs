//! What a device has made comes back to memory.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use super::Device;
use crate::compute::GpuError;

const PENDING: u8 = 0;
const READY: u8 = 1;
const FAILED: u8 = 2;

/// A buffer that the processor can map.
pub struct Readback {
    buffer: wgpu::Buffer,
    state: Arc<AtomicU8>,
}

impl Readback {
    /// For so many bytes.
    pub fn new(device: &Device, label: &str, bytes: usize) -> Self {
        let buffer = device.buffer(label, bytes, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);
        Self { buffer, state: Arc::new(AtomicU8::new(PENDING)) }
    }

    /// Bytes that it has place for.
    pub fn size(&self) -> u64 {
        self.buffer.size()
    }

    /// Runs what was encoded, then copies the first `bytes` of `source`, whole words, waits for them, and gives them to `take`.
    ///
    /// # Errors
    /// The device failed, or took too long.
    pub fn fetch<T>(
        &self,
        device: &Device,
        mut encoder: wgpu::CommandEncoder,
        (source, bytes): (&wgpu::Buffer, u64),
        take: impl FnOnce(&[u8]) -> T,
    ) -> Result<T, GpuError> {
        encoder.copy_buffer_to_buffer(source, 0, &self.buffer, 0, bytes);
        let submission = device.queue.submit([encoder.finish()]);
        self.state.store(PENDING, Ordering::Relaxed);
        let state = Arc::clone(&self.state);
        self.buffer.map_async(wgpu::MapMode::Read, ..bytes, move |mapped| {
            state.store(if mapped.is_ok() { READY } else { FAILED }, Ordering::Release);
        });
        device.poll(Some(submission))?;
        // Where others use the device, too, one of them may be about to run the callback.
        device.wait_for(|| self.state.load(Ordering::Acquire) != PENDING)?;
        let fault = |what: &dyn std::fmt::Display| GpuError::Failed(format!("{}: {what}", device.name));
        if self.state.load(Ordering::Acquire) != READY {
            return Err(fault(&"what it made could not be read back"));
        }
        let taken = {
            let view = self.buffer.get_mapped_range(..bytes).map_err(|error| fault(&error))?;
            take(&view)
        };
        self.buffer.unmap();
        Ok(taken)
    }
}
