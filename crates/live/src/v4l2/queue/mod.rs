//! The queue of memory-mapped buffers between a driver and this program: which side owns each, and its content.
//!
//! Each buffer belongs to the kernel (to fill, or filled) or to us; one of ours may hold the current frame. All are
//! queued before the stream starts and requeued as soon as they are read: a driver without buffers drops frames.

mod buffer;
mod error;
mod kernel;
#[cfg(test)]
mod model;
mod sequence;
#[cfg(test)]
mod tests;

use std::io;
use std::time::Duration;

pub use buffer::{ByteRange, Dequeued, Losses, MAX_PLANES, Planes};
pub use error::QueueError;
pub use kernel::{BufferInfo, DeviceKernel, Kernel, Mapping, Span, Wake, Writer};
pub use sequence::Sequence;

use bokehcam::clock::Clock;

/// Requested buffers. With fewer than four, some drivers were seen to drop frames.
const BUFFERS: u32 = 4;
/// With one buffer, every other frame is lost.
const MIN_BUFFERS: u32 = 2;
/// How often a buffer is offered before a refusal keeps the stream from starting.
const MAX_OFFERS: u32 = 3;

/// A buffer: its mapped planes, and which side owns it.
struct Slot<M> {
    memory: Vec<M>,
    in_kernel: bool,
}

/// A capture queue with its buffers. Dropping it stops the stream, unmaps the buffers and frees them, in this order.
pub struct Queue<K: Kernel> {
    kernel: K,
    clock: Clock,
    slots: Vec<Slot<K::Memory>>,
    /// Minimum bytes in each plane of a complete frame.
    min_bytes: Vec<usize>,
    sequence: Sequence,
    /// The frame that can be read now.
    current: Option<Dequeued>,
    losses: Losses,
}

impl<K: Kernel> Queue<K> {
    /// Requests buffers from the kernel and maps them. A frame with less than `min_bytes` in a plane is corrupt;
    /// frames are expected every `period_ns`.
    ///
    /// # Errors
    /// The kernel grants too few buffers, or they cannot be mapped.
    pub fn new(kernel: K, min_bytes: &[usize], period_ns: u64, clock: Clock) -> Result<Self, QueueError> {
        let min_bytes = min_bytes.to_vec();
        let sequence = Sequence::new(period_ns);
        let (slots, current, losses) = (Vec::new(), None, Losses::default());
        let mut queue = Self { kernel, clock, slots, min_bytes, sequence, current, losses };
        // Created first, so that an early return drops it, which frees the buffers granted so far.
        let granted =
            retry_interrupted(|| queue.kernel.request_buffers(BUFFERS)).map_err(QueueError::refused_at("REQBUFS"))?;
        if granted < MIN_BUFFERS {
            return Err(QueueError::TooFewBuffers { granted });
        }
        for index in 0..granted {
            let info =
                retry_interrupted(|| queue.kernel.query_buffer(index)).map_err(QueueError::refused_at("QUERYBUF"))?;
            let mut memory = Vec::with_capacity(info.plane_count);
            for span in &info.planes[..info.plane_count] {
                memory
                    .push(retry_interrupted(|| queue.kernel.map_plane(*span)).map_err(QueueError::refused_at("mmap"))?);
            }
            queue.slots.push(Slot { memory, in_kernel: false });
        }
        Ok(queue)
    }

    pub fn kernel(&self) -> &K {
        &self.kernel
    }

    /// Queues every buffer and starts the stream.
    ///
    /// # Errors
    /// A buffer or the stream is refused. The stream is then stopped; starting may be tried again.
    pub fn start(&mut self) -> Result<(), QueueError> {
        self.sequence.restart();
        let started = self.try_start();
        if started.is_err() {
            self.stop();
        }
        started
    }

    /// Starts like [`Queue::start`], but leaves the buffers with the kernel when it fails.
    fn try_start(&mut self) -> Result<(), QueueError> {
        for index in 0..self.slots.len() {
            let mut offers = 0;
            while !self.slots[index].in_kernel {
                offers += 1;
                match self.enqueue(index) {
                    Err(source) if offers == MAX_OFFERS => return Err(QueueError::Refused { step: "QBUF", source }),
                    _ => {}
                }
            }
        }
        retry_interrupted(|| self.kernel.stream_on()).map_err(QueueError::refused_at("STREAMON"))
    }

    /// Stops the stream; every buffer is returned, and the current frame is discarded.
    pub fn stop(&mut self) {
        self.discard_current();
        let stopped = retry_interrupted(|| self.kernel.stream_off());
        for index in 0..self.slots.len() {
            // A successful stop returns them all; after a failed one, query each.
            self.slots[index].in_kernel = stopped.is_err() && self.is_in_kernel(index).unwrap_or(false);
        }
    }

    /// Waits for a frame, for at most `timeout`, and makes the newest available one current. Older ones, and one that
    /// was still current, count as stale. Returns whether there is a frame.
    ///
    /// # Errors
    /// The driver's error; the next call may succeed.
    pub fn wait_newest(&mut self, timeout: Duration) -> Result<bool, QueueError> {
        self.discard_current();
        // Offers again the buffers that the kernel refused before.
        for index in 0..self.slots.len() {
            if !self.slots[index].in_kernel {
                let _ = self.enqueue(index);
            }
        }
        let until_ns = self.clock.now_ns() + timeout.as_nanos() as u64;
        loop {
            let left = Duration::from_nanos(until_ns.saturating_sub(self.clock.now_ns()));
            match self.kernel.wait(left) {
                Ok(Wake::TimedOut) => return Ok(false),
                Ok(Wake::Filled) => {}
                Ok(Wake::Error) => {
                    self.drain_filled()?;
                    return match self.current {
                        Some(_) => Ok(true),
                        // An error without a buffer: returned, since every further wait would end at once, too.
                        None => Err(QueueError::refused_at("poll")(io::Error::from_raw_os_error(EIO))),
                    };
                }
                // A signal: continue waiting for the remaining time.
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(QueueError::refused_at("poll")(error)),
            }
            self.drain_filled()?;
            if self.current.is_some() {
                return Ok(true);
            }
            if self.clock.now_ns() >= until_ns {
                return Ok(false);
            }
        }
    }

    /// Dequeues all filled buffers and keeps the newest complete frame.
    fn drain_filled(&mut self) -> Result<(), QueueError> {
        // Bounded: a driver that fills buffers as fast as they are drained must not keep us here.
        for _ in 0..2 * self.slots.len() {
            match retry_interrupted(|| self.kernel.dequeue_buffer()) {
                Ok(frame) => self.accept_frame(frame)?,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                Err(error) => {
                    self.find_lost_buffers();
                    // The frame takes precedence; a lasting error will recur.
                    return if self.current.is_some() { Ok(()) } else { Err(QueueError::refused_at("DQBUF")(error)) };
                }
            }
        }
        Ok(())
    }

    /// Makes a dequeued frame the current one, replacing an older one; a corrupt one is counted and requeued.
    fn accept_frame(&mut self, frame: Dequeued) -> Result<(), QueueError> {
        let index = frame.index as usize;
        match self.slots.get_mut(index) {
            Some(slot) if slot.in_kernel => slot.in_kernel = false,
            _ => return Err(QueueError::Foreign(frame.index)),
        }
        self.losses.missed += self.sequence.count_lost(frame.sequence, frame.stamp_ns);
        if !self.is_complete(&frame) {
            self.losses.corrupt += 1;
            let _ = self.enqueue(index);
            return Ok(());
        }
        self.discard_current();
        let Self { kernel, slots, .. } = self;
        for (memory, range) in slots[index].memory.iter_mut().zip(frame.filled) {
            kernel.snapshot(memory, range.end);
        }
        self.current = Some(frame);
        Ok(())
    }

    /// Whether the driver did not flag the frame as damaged, and each plane has its minimum bytes within its mapping.
    fn is_complete(&self, frame: &Dequeued) -> bool {
        let memory = &self.slots[frame.index as usize].memory;
        let filled = frame.filled.iter().zip(memory);
        !frame.flagged
            && filled.enumerate().all(|(plane, (range, memory))| {
                let min_bytes = self.min_bytes.get(plane).copied().unwrap_or(1).max(1);
                range.end <= memory.as_ref().len() && range.end.saturating_sub(range.start) >= min_bytes
            })
    }

    /// The current frame and its planes.
    pub fn current(&self) -> Option<(Dequeued, Planes<'_>)> {
        let frame = self.current?;
        let memory = &self.slots[frame.index as usize].memory;
        let mut planes: [&[u8]; MAX_PLANES] = [&[]; MAX_PLANES];
        for ((plane, memory), range) in planes.iter_mut().zip(memory).zip(frame.filled) {
            *plane = &memory.as_ref()[range.start..range.end];
        }
        Some((frame, Planes { planes, count: memory.len() }))
    }

    /// Requeues the buffer of the current frame, which was read.
    pub fn release(&mut self) {
        if let Some(frame) = self.current.take() {
            // If it is refused, it is offered again later.
            let _ = self.enqueue(frame.index as usize);
        }
    }

    /// Discards all frames filled so far and all losses so far: counting starts with the next frame.
    pub fn reset_losses(&mut self) {
        let _ = self.drain_filled();
        self.release();
        self.sequence.restart();
        self.losses = Losses::default();
    }

    /// Returns the frames lost since the last call.
    pub fn take_losses(&mut self) -> Losses {
        std::mem::take(&mut self.losses)
    }

    fn discard_current(&mut self) {
        if self.current.is_some() {
            self.losses.stale += 1;
            self.release();
        }
    }

    /// Queues a buffer of ours with the kernel.
    fn enqueue(&mut self, index: usize) -> io::Result<()> {
        let queued = retry_interrupted(|| self.kernel.queue_buffer(index as u32));
        // EINVAL may mean that the kernel has the buffer already.
        self.slots[index].in_kernel = match &queued {
            Ok(()) => true,
            Err(error) if error.kind() == io::ErrorKind::InvalidInput => self.is_in_kernel(index).unwrap_or(false),
            Err(_) => false,
        };
        queued
    }

    fn is_in_kernel(&mut self, index: usize) -> io::Result<bool> {
        retry_interrupted(|| self.kernel.query_buffer(index as u32)).map(|info| info.in_kernel)
    }

    /// Queries which buffers the kernel still has: a failed dequeue may have taken one all the same. The next frame's
    /// sequence number then reveals the lost frame.
    fn find_lost_buffers(&mut self) {
        for index in 0..self.slots.len() {
            if self.slots[index].in_kernel {
                self.slots[index].in_kernel = self.is_in_kernel(index).unwrap_or(true);
            }
        }
    }
}

const EIO: i32 = rustix::io::Errno::IO.raw_os_error();

impl<K: Kernel> Drop for Queue<K> {
    fn drop(&mut self) {
        if !self.slots.is_empty() {
            self.stop();
        }
        self.slots.clear();
        // A device that is gone has nothing left to free.
        let _ = retry_interrupted(|| self.kernel.request_buffers(0));
    }
}

/// Repeats a call that a signal interrupted.
fn retry_interrupted<T>(mut call: impl FnMut() -> io::Result<T>) -> io::Result<T> {
    loop {
        match call() {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            done => return done,
        }
    }
}
