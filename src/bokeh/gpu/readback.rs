//! The way back from the device: a ring of buffers, copied to after a frame and mapped later, so that submitting never
//! waits. A picture that stays on the device goes the same way, without being copied.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::{Duration, Instant};

use crate::bokeh::{BokehError, Finished, Job, PassTimes, Picture};
use crate::compute::GpuError;
use crate::compute::device::{Device, DevicePicture};
use crate::link::pool::Pooled;

/// Frames that may be in flight: one on the device, one waiting, one on its way back.
pub const CAPACITY: usize = 3;
/// Timestamps a frame can have.
pub const MAX_QUERIES: u32 = 512;

const PENDING: u8 = 0;
const READY: u8 = 1;
const FAILED: u8 = 2;

/// Buffers of one frame in flight.
pub struct Slot {
    pub picture: wgpu::Buffer,
    /// Timestamps: two per pass.
    pub stamps: Option<wgpu::Buffer>,
    /// Name of each timed pass, in order.
    pub passes: Vec<&'static str>,
}

/// A frame that was submitted.
pub struct Sent {
    /// What was to be done.
    pub job: Job,
    /// Where the result is left on the device.
    pub on_device: Option<Pooled<DevicePicture>>,
    /// Bytes of it that were copied to the slot; 0 where it stays on the device.
    pub copied: u64,
    /// What to wait for.
    pub submission: wgpu::SubmissionIndex,
    /// When it was begun.
    pub started: Instant,
}

/// A frame whose buffers are being mapped.
struct Pending {
    slot: Slot,
    sent: Sent,
    /// [`PENDING`], [`READY`] or [`FAILED`]: set by the device's callback.
    state: Arc<AtomicU8>,
}

/// The frames on their way back, and the buffers for more.
pub struct Ring {
    free: Vec<Slot>,
    pending: VecDeque<Pending>,
    /// When the last frame was back.
    last: Option<Instant>,
}

impl Ring {
    /// A ring for pictures of `bytes` (a multiple of 4).
    pub fn new(device: &Device, bytes: u64) -> Self {
        let buffer = |label, size| {
            device.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let slot = || Slot {
            picture: buffer("picture back", bytes),
            stamps: device.timestamps.then(|| buffer("stamps back", u64::from(MAX_QUERIES) * 8)),
            passes: Vec::with_capacity(MAX_QUERIES as usize / 2),
        };
        let free = std::iter::repeat_with(slot).take(CAPACITY).collect();
        Self { free, pending: VecDeque::with_capacity(CAPACITY), last: None }
    }

    /// A slot to copy a frame to.
    pub fn take(&mut self) -> Option<Slot> {
        self.free.pop()
    }

    pub fn in_flight(&self) -> usize {
        self.pending.len()
    }

    /// Gives back the oldest frame in flight as it was submitted, after an error: its buffers are dropped.
    pub fn give_up(&mut self) -> Option<Job> {
        self.pending.pop_front().map(|pending| pending.sent.job)
    }

    /// Starts the way back of a frame that was submitted.
    pub fn push(&mut self, device: &Device, slot: Slot, sent: Sent) {
        let state = Arc::new(AtomicU8::new(PENDING));
        let done = Arc::clone(&state);
        let done = move |is_ok: bool| done.store(if is_ok { READY } else { FAILED }, Ordering::Release);
        // Only the last mapping reports: callbacks run in the order of the calls, so all is mapped then.
        match &slot.stamps {
            Some(stamps) if sent.copied == 0 => {
                stamps.map_async(wgpu::MapMode::Read, .., move |result| done(result.is_ok()));
            }
            None if sent.copied == 0 => device.queue.on_submitted_work_done(move || done(true)),
            stamps => {
                if let Some(stamps) = stamps {
                    stamps.map_async(wgpu::MapMode::Read, .., |_| {});
                }
                slot.picture.map_async(wgpu::MapMode::Read, ..sent.copied, move |result| done(result.is_ok()));
            }
        }
        self.pending.push_back(Pending { slot, sent, state });
    }

    /// The oldest frame, if it is back; with `wait`, blocks until it is.
    ///
    /// # Errors
    /// The device failed.
    pub fn pop(&mut self, device: &Device, wait: bool) -> Result<Option<Finished>, BokehError> {
        let Some(oldest) = self.pending.front() else { return Ok(None) };
        device.poll(wait.then(|| oldest.sent.submission.clone()))?;
        if wait {
            device.wait_for(|| oldest.state.load(Ordering::Acquire) != PENDING)?;
        }
        match oldest.state.load(Ordering::Acquire) {
            PENDING => return Ok(None),
            FAILED => {
                return Err(GpuError::Failed(format!("{}: the picture could not be read back", device.name)).into());
            }
            _ => {}
        }
        let Some(Pending { slot, sent, .. }) = self.pending.front_mut() else { return Ok(None) };
        let Sent { job, copied, started, .. } = sent;
        let (copied, started) = (*copied, *started);
        let fault = |error: wgpu::MapRangeError| GpuError::Failed(error.to_string());
        if copied > 0 {
            {
                let bytes = slot.picture.get_mapped_range(..copied).map_err(fault)?;
                let out = job.yuyv.as_mut().map_or(&mut job.out.rgb, |yuyv| &mut yuyv.bytes);
                let length = out.len();
                out.copy_from_slice(&bytes[..length]);
            }
            slot.picture.unmap();
        }
        let mut times = PassTimes::new();
        if let Some(stamps) = &slot.stamps {
            {
                let bytes = stamps.get_mapped_range(..).map_err(fault)?;
                let stamp =
                    |k: usize| bytes.get(k * 8..k * 8 + 8).and_then(|b| b.try_into().ok()).map(u64::from_le_bytes);
                let period_ns = f64::from(device.queue.get_timestamp_period());
                for (k, name) in slot.passes.iter().enumerate() {
                    let Some((from, to)) = stamp(2 * k).zip(stamp(2 * k + 1)) else { continue };
                    if to < from {
                        // Stamps may run backwards when clocks change; such a frame's times say nothing.
                        times = PassTimes::new();
                        break;
                    }
                    times.add(name, Duration::from_nanos(((to - from) as f64 * period_ns) as u64));
                }
            }
            stamps.unmap();
        } else {
            // Frames run one after the other: the time before the previous one was back does not count.
            let began = self.last.map_or(started, |last| last.max(started));
            times.add("gpu", began.elapsed());
        }
        self.last = Some(Instant::now());
        // Only now, so that the frame can be given back after an error.
        let Some(Pending { mut slot, sent, .. }) = self.pending.pop_front() else { return Ok(None) };
        let Sent { job, on_device, .. } = sent;
        slot.passes.clear();
        self.free.push(slot);
        let Job { ticket, color, depth, out, yuyv, .. } = job;
        let picture = match (on_device, yuyv) {
            (Some(device), _) => Picture::on_device(device, out, copied > 0),
            (None, Some(yuyv)) => Picture::as_yuyv(yuyv, out),
            (None, None) => Picture::in_memory(out),
        };
        Ok(Some(Finished { ticket, picture, color, depth, times }))
    }
}
