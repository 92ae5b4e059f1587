//! Readback from a device to the host.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use super::Device;
use crate::compute::GpuError;

/// Buffer that the device copies to and the host maps.
pub struct Readback {
    buffer: wgpu::Buffer,
    /// [`PENDING`], [`READY`] or [`FAILED`]: set by the device's callback.
    state: Arc<AtomicU8>,
    /// Bytes of the last copy.
    copied: u64,
}

const READY: u8 = 0;
const PENDING: u8 = 1;
const FAILED: u8 = 2;

impl Readback {
    /// Allocates `bytes` bytes.
    pub fn new(device: &Device, label: &str, bytes: usize) -> Self {
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        Self { buffer: device.create_buffer(label, bytes, usage), state: Arc::new(AtomicU8::new(READY)), copied: 0 }
    }

    /// Returns the capacity in bytes.
    pub fn size(&self) -> u64 {
        self.buffer.size()
    }

    /// Records a copy of the first `bytes` of `source`, whole words.
    pub fn record_copy(&mut self, encoder: &mut wgpu::CommandEncoder, source: &wgpu::Buffer, bytes: u64) {
        encoder.copy_buffer_to_buffer(source, 0, &self.buffer, 0, bytes);
        self.copied = bytes;
    }

    /// Requests the mapping of the copied bytes, after the submission.
    pub fn map(&self) {
        self.state.store(PENDING, Ordering::Relaxed);
        let state = Arc::clone(&self.state);
        self.buffer.map_async(wgpu::MapMode::Read, ..self.copied, move |mapped| {
            state.store(if mapped.is_ok() { READY } else { FAILED }, Ordering::Release);
        });
    }

    /// Whether the mapping is still pending.
    pub fn is_pending(&self) -> bool {
        self.state.load(Ordering::Acquire) == PENDING
    }

    /// Calls `take` with the copied bytes, and unmaps them.
    ///
    /// # Errors
    /// The mapping is not ready or failed.
    pub fn read<T>(&self, device: &Device, take: impl FnOnce(&[u8]) -> T) -> Result<T, GpuError> {
        let fault = |error: &dyn std::fmt::Display| GpuError::Failed(format!("{}: {error}", device.name));
        if self.state.load(Ordering::Acquire) != READY {
            return Err(fault(&"a result could not be read back"));
        }
        let taken = take(&self.buffer.get_mapped_range(..self.copied).map_err(|error| fault(&error))?);
        self.buffer.unmap();
        Ok(taken)
    }
}
