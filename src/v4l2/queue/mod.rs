//! The queue of buffers between a driver and us, mapped into our memory: which side has each, and what came in it.
//!
//! Every buffer is the kernel's (to fill, or filled) or ours; one of ours may hold the current frame. All are queued
//! before the stream starts and go back as soon as they are read: a driver that has none drops frames.

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

pub use buffer::{Dequeued, Losses, MAX_PLANES, Part, Planes};
pub use error::QueueError;
pub use kernel::{Described, DeviceKernel, Kernel, Mapping, Span, Wake, Writer};
pub use sequence::Sequence;

use crate::clock::Clock;

/// Buffers asked for. Fewer than four were seen to make drivers drop frames.
const BUFFERS: u32 = 4;
/// With one buffer, every other frame is lost.
const LEAST_BUFFERS: u32 = 2;
/// How often a refused buffer is offered again before the stream starts.
const OFFERS: u32 = 3;

/// A buffer: its mapped planes, and which side has it.
struct Slot<M> {
    memory: Vec<M>,
    in_kernel: bool,
}

/// A capture queue with its buffers. Dropping it stops the stream, unmaps the buffers and frees them, in this order.
pub struct Queue<K: Kernel> {
    kernel: K,
    clock: Clock,
    slots: Vec<Slot<K::Memory>>,
    /// Least bytes in each plane of an uncut frame.
    least_bytes: Vec<usize>,
    sequence: Sequence,
    /// The frame that is given out.
    current: Option<Dequeued>,
    losses: Losses,
}

impl<K: Kernel> Queue<K> {
    /// Asks the kernel for buffers and maps them. A frame with less than `least_bytes` in a plane is corrupt; frames
    /// are expected every `period_ns`.
    ///
    /// # Errors
    /// It gives none or too few, or they cannot be mapped.
    pub fn new(kernel: K, least_bytes: &[usize], period_ns: u64, clock: Clock) -> Result<Self, QueueError> {
        let least_bytes = least_bytes.to_vec();
        let sequence = Sequence::new(period_ns);
        let (slots, current, losses) = (Vec::new(), None, Losses::default());
        let mut queue = Self { kernel, clock, slots, least_bytes, sequence, current, losses };
        // Made first, so that an early return drops it, which frees the buffers granted until then.
        let granted = retry(|| queue.kernel.request(BUFFERS)).map_err(QueueError::at("REQBUFS"))?;
        if granted < LEAST_BUFFERS {
            return Err(QueueError::TooFewBuffers { granted });
        }
        for index in 0..granted {
            let described = retry(|| queue.kernel.query(index)).map_err(QueueError::at("QUERYBUF"))?;
            let mut memory = Vec::with_capacity(described.plane_count);
            for span in &described.planes[..described.plane_count] {
                memory.push(retry(|| queue.kernel.map(*span)).map_err(QueueError::at("mmap"))?);
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

    /// As [`Queue::start`], but leaves the buffers with the kernel when it fails.
    fn try_start(&mut self) -> Result<(), QueueError> {
        for index in 0..self.slots.len() {
            let mut offers = 0;
            while !self.slots[index].in_kernel {
                offers += 1;
                match self.give(index) {
                    Err(source) if offers == OFFERS => return Err(QueueError::Refused { step: "QBUF", source }),
                    _ => {}
                }
            }
        }
        retry(|| self.kernel.stream_on()).map_err(QueueError::at("STREAMON"))
    }

    /// Stops the stream; every buffer comes back, the current frame's content is gone.
    pub fn stop(&mut self) {
        self.pass_over_current();
        let stopped = retry(|| self.kernel.stream_off());
        for index in 0..self.slots.len() {
            // A successful stop returns them all; after a failed one, ask about each.
            self.slots[index].in_kernel = stopped.is_err() && self.is_in_kernel(index).unwrap_or(false);
        }
    }

    /// Waits for a frame, no longer than `patience`, and makes the newest of all that are there the current one; older
    /// ones, and one that still was current, count as stale. Returns whether there is one.
    ///
    /// # Errors
    /// What the driver says; the next call may succeed.
    pub fn wait_newest(&mut self, patience: Duration) -> Result<bool, QueueError> {
        self.pass_over_current();
        // Offers again the buffers that the kernel refused before.
        for index in 0..self.slots.len() {
            if !self.slots[index].in_kernel {
                let _ = self.give(index);
            }
        }
        let until_ns = self.clock.now_ns() + patience.as_nanos() as u64;
        loop {
            let left = Duration::from_nanos(until_ns.saturating_sub(self.clock.now_ns()));
            match self.kernel.wait(left) {
                Ok(Wake::Late) => return Ok(false),
                Ok(Wake::Filled) => {}
                Ok(Wake::Trouble) => {
                    self.drain()?;
                    return match self.current {
                        Some(_) => Ok(true),
                        // An error without a buffer: returned, since every further wait would end at once, too.
                        None => Err(QueueError::at("poll")(io::Error::from_raw_os_error(EIO))),
                    };
                }
                // A signal: waits on for the time that is left.
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(QueueError::at("poll")(error)),
            }
            self.drain()?;
            if self.current.is_some() {
                return Ok(true);
            }
            if self.clock.now_ns() >= until_ns {
                return Ok(false);
            }
        }
    }

    /// Dequeues all that is filled and keeps the newest whole frame.
    fn drain(&mut self) -> Result<(), QueueError> {
        // Bounded: a driver that fills buffers as fast as they are drained must not keep us here.
        for _ in 0..2 * self.slots.len() {
            match retry(|| self.kernel.dequeue()) {
                Ok(frame) => self.accept(frame)?,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                Err(error) => {
                    self.find_lost_buffers();
                    // The frame comes first; an error that lasts will come again.
                    return if self.current.is_some() { Ok(()) } else { Err(QueueError::at("DQBUF")(error)) };
                }
            }
        }
        Ok(())
    }

    /// Makes a dequeued frame the current one, in place of an older one; a corrupt one is counted and queued again.
    fn accept(&mut self, frame: Dequeued) -> Result<(), QueueError> {
        let index = frame.index as usize;
        match self.slots.get_mut(index) {
            Some(slot) if slot.in_kernel => slot.in_kernel = false,
            _ => return Err(QueueError::Foreign(frame.index)),
        }
        self.losses.missed += self.sequence.step(frame.sequence, frame.stamp_ns);
        if !self.is_whole(&frame) {
            self.losses.corrupt += 1;
            let _ = self.give(index);
            return Ok(());
        }
        self.pass_over_current();
        let Self { kernel, slots, .. } = self;
        for (memory, part) in slots[index].memory.iter_mut().zip(frame.parts) {
            kernel.settle(memory, part.end);
        }
        self.current = Some(frame);
        Ok(())
    }

    /// Whether the driver did not flag the frame as damaged, and each plane has its least bytes within its mapping.
    fn is_whole(&self, frame: &Dequeued) -> bool {
        let memory = &self.slots[frame.index as usize].memory;
        let parts = frame.parts.iter().zip(memory);
        !frame.flagged
            && parts.enumerate().all(|(plane, (part, memory))| {
                let least_bytes = self.least_bytes.get(plane).copied().unwrap_or(1).max(1);
                part.end <= memory.as_ref().len() && part.end.saturating_sub(part.start) >= least_bytes
            })
    }

    /// The current frame and its planes.
    pub fn current(&self) -> Option<(Dequeued, Planes<'_>)> {
        let frame = self.current?;
        let memory = &self.slots[frame.index as usize].memory;
        let mut planes: [&[u8]; MAX_PLANES] = [&[]; MAX_PLANES];
        for ((plane, memory), part) in planes.iter_mut().zip(memory).zip(frame.parts) {
            *plane = &memory.as_ref()[part.start..part.end];
        }
        Some((frame, Planes { planes, count: memory.len() }))
    }

    /// The current frame was read: its buffer goes back.
    pub fn release(&mut self) {
        if let Some(frame) = self.current.take() {
            // If it is refused, it is offered again later.
            let _ = self.give(frame.index as usize);
        }
    }

    /// Discards all frames that are filled by now, and all losses until now: counting begins with the next frame.
    pub fn begin(&mut self) {
        let _ = self.drain();
        self.release();
        self.sequence.restart();
        self.losses = Losses::default();
    }

    /// The frames lost since this was asked last.
    pub fn take_losses(&mut self) -> Losses {
        std::mem::take(&mut self.losses)
    }

    fn pass_over_current(&mut self) {
        if self.current.is_some() {
            self.losses.stale += 1;
            self.release();
        }
    }

    /// Gives a buffer of ours to the kernel.
    fn give(&mut self, index: usize) -> io::Result<()> {
        let given = retry(|| self.kernel.queue(index as u32));
        // EINVAL may mean that the kernel has the buffer already.
        self.slots[index].in_kernel = match &given {
            Ok(()) => true,
            Err(error) if error.kind() == io::ErrorKind::InvalidInput => self.is_in_kernel(index).unwrap_or(false),
            Err(_) => false,
        };
        given
    }

    fn is_in_kernel(&mut self, index: usize) -> io::Result<bool> {
        retry(|| self.kernel.query(index as u32)).map(|described| described.in_kernel)
    }

    /// Asks which buffers the kernel still has: a failed dequeue may have taken one all the same. Its frame shows as
    /// missed by the next one's number.
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
        // Of a device that is gone, nothing is left to free.
        let _ = retry(|| self.kernel.request(0));
    }
}

/// Calls again when a signal came between.
fn retry<T>(mut call: impl FnMut() -> io::Result<T>) -> io::Result<T> {
    loop {
        match call() {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            done => return done,
        }
    }
}
