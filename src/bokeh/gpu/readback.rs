//! Readback of results: a ring of buffers, copied to after a frame and mapped later, so that submitting never waits.
//! Pictures that stay on the device use the same ring without a copy.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use crate::bokeh::{BlurredFrame, BokehError, Job, PassTimes, Picture};
use crate::compute::device::{Device, DevicePicture, Readback, Timestamps};
use crate::link::pool::Pooled;

/// Largest number of frames in flight: one on the device, one waiting, one being read back.
pub const CAPACITY: usize = 3;
/// Largest number of timed passes per frame.
const MAX_PASSES: usize = 256;

/// Buffers of one frame in flight.
pub struct RingSlot {
    pub picture: Readback,
    pub stamps: Option<Timestamps>,
}

/// A submitted frame.
pub struct SubmittedFrame {
    /// The job as it was submitted.
    pub job: Job,
    /// Copy of the result that stays on the device.
    pub on_device: Option<Pooled<DevicePicture>>,
    /// Bytes of the result that are copied to the slot; 0 if it stays on the device.
    pub copied: u64,
    /// Submission to wait for.
    pub submission: wgpu::SubmissionIndex,
    /// Time of the submission.
    pub started: Instant,
}

/// A frame being read back.
struct Pending {
    slot: RingSlot,
    sent: SubmittedFrame,
    /// Whether the device has finished it.
    done: Arc<AtomicBool>,
}

impl Pending {
    fn is_read_back(&self) -> bool {
        self.done.load(Ordering::Acquire)
            && !self.slot.picture.is_pending()
            && !self.slot.stamps.as_ref().is_some_and(Timestamps::are_pending)
    }
}

/// Frames being read back, and free buffers for more.
pub struct Ring {
    free: Vec<RingSlot>,
    pending: VecDeque<Pending>,
    /// Time at which the last frame was read back.
    last: Option<Instant>,
}

impl Ring {
    /// Creates a ring for pictures of `bytes` bytes (a multiple of 4).
    pub fn new(device: &Device, bytes: usize) -> Self {
        let slot = || RingSlot {
            picture: Readback::new(device, "picture back", bytes),
            stamps: Timestamps::new(device, MAX_PASSES),
        };
        let free = std::iter::repeat_with(slot).take(CAPACITY).collect();
        Self { free, pending: VecDeque::with_capacity(CAPACITY), last: None }
    }

    /// Returns a free slot, if any.
    pub fn take_slot(&mut self) -> Option<RingSlot> {
        self.free.pop()
    }

    pub fn in_flight(&self) -> usize {
        self.pending.len()
    }

    /// After an error, returns the oldest frame in flight as it was submitted; its buffers are dropped.
    pub fn reclaim_job(&mut self) -> Option<Job> {
        self.pending.pop_front().map(|pending| pending.sent.job)
    }

    /// Starts the readback of a submitted frame.
    pub fn push(&mut self, device: &Device, slot: RingSlot, sent: SubmittedFrame) {
        if sent.copied > 0 {
            slot.picture.map();
        }
        let done = Arc::new(AtomicBool::new(false));
        let is_done = Arc::clone(&done);
        device.queue.on_submitted_work_done(move || is_done.store(true, Ordering::Release));
        self.pending.push_back(Pending { slot, sent, done });
    }

    /// Returns the oldest frame if it is finished; with `wait`, blocks until it is.
    ///
    /// # Errors
    /// The device failed.
    pub fn pop(&mut self, device: &Device, wait: bool) -> Result<Option<BlurredFrame>, BokehError> {
        let Some(oldest) = self.pending.front() else { return Ok(None) };
        device.poll(wait.then(|| oldest.sent.submission.clone()))?;
        if wait {
            device.wait_for(|| oldest.is_read_back())?;
        }
        if !oldest.is_read_back() {
            return Ok(None);
        }
        let Some(Pending { slot, sent, .. }) = self.pending.front_mut() else { return Ok(None) };
        if sent.copied > 0 {
            let out = sent.job.yuyv.as_mut().map_or(&mut sent.job.out.rgb, |yuyv| &mut yuyv.bytes);
            let length = out.len();
            slot.picture.read(device, |bytes| out.copy_from_slice(&bytes[..length]))?;
        }
        let mut times = PassTimes::new();
        if let Some(stamps) = &slot.stamps {
            times = stamps.read(device)?;
        } else {
            // Frames run one after the other: time before the previous frame was finished does not count.
            let began = self.last.map_or(sent.started, |last| last.max(sent.started));
            times.add("gpu", began.elapsed());
        }
        self.last = Some(Instant::now());
        // Removed only now, so that the frame can be taken back after an error.
        let Some(Pending { slot, sent, .. }) = self.pending.pop_front() else { return Ok(None) };
        let SubmittedFrame { job, on_device, copied, .. } = sent;
        self.free.push(slot);
        let Job { ticket, color, depth, out, yuyv, .. } = job;
        let picture = match (on_device, yuyv) {
            (Some(device), _) => Picture::from_device(device, out, copied > 0),
            (None, Some(yuyv)) => Picture::from_yuyv(yuyv, out),
            (None, None) => Picture::from_memory(out),
        };
        Ok(Some(BlurredFrame { ticket, picture, color, depth, times }))
    }
}
