//! A model of the kernel's side of a queue. It tracks every buffer's state, fails at random where a kernel may, and
//! panics where its user breaks a rule of V4L2.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::io;
use std::rc::Rc;
use std::time::Duration;

use super::{BufferInfo, ByteRange, Dequeued, Kernel, MAX_PLANES, Span, Wake};
use bokehcam::clock::Clock;

const EINTR: i32 = 4;
pub const EIO: i32 = 5;
const EAGAIN: i32 = 11;
pub const EBUSY: i32 = 16;
pub const ENODEV: i32 = 19;
pub const EINVAL: i32 = 22;
pub const ENOSPC: i32 = 28;

pub const PERIOD_NS: u64 = 10_000_000;
pub const PLANE_BYTES: usize = 64;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Buffer {
    Dequeued,
    Queued,
    Done { sequence: u32, flagged: bool, used_bytes: usize },
}

/// Probability of each failure per call, from 0 to 1.
#[derive(Clone, Copy, Debug, Default)]
pub struct Chances {
    pub interrupted: f64,
    pub refused: f64,
    pub dropped: f64,
    pub damaged: f64,
    pub gone: f64,
}

/// The events, as the kernel saw them.
#[derive(Clone, Debug, Default)]
pub struct Facts {
    /// Frames delivered, damaged ones included.
    pub delivered: u64,
    /// Damaged frames among those delivered.
    pub damaged: u64,
    /// Frames lost between those delivered.
    pub missed: u64,
    /// Largest number of buffers that the kernel had at once, filled or to be filled.
    pub max_queued: usize,
    pub starts: u64,
}

pub struct State {
    random: u64,
    pub chances: Chances,
    pub granted: u32,
    clock: Clock,
    buffers: Vec<Buffer>,
    /// Queued buffers, filled ones included, in the order in which they were queued.
    order: VecDeque<u32>,
    streaming: bool,
    mapped: usize,
    sequence: u32,
    last_delivered: Option<u32>,
    pub gone: bool,
    /// Whether queries about buffers fail.
    pub queries_fail: bool,
    pub facts: Facts,
}

/// The model; clones share their state.
#[derive(Clone)]
pub struct Model(pub Rc<RefCell<State>>);

/// A mapped plane of the model.
pub struct Memory {
    bytes: [u8; PLANE_BYTES],
    model: Rc<RefCell<State>>,
}

impl AsRef<[u8]> for Memory {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        self.model.borrow_mut().mapped -= 1;
    }
}

fn error<T>(errno: i32) -> io::Result<T> {
    Err(io::Error::from_raw_os_error(errno))
}

impl Model {
    pub fn new(seed: u64, chances: Chances, clock: Clock) -> Self {
        Self(Rc::new(RefCell::new(State {
            random: seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1,
            chances,
            granted: 4,
            clock,
            buffers: Vec::new(),
            order: VecDeque::new(),
            streaming: false,
            mapped: 0,
            sequence: 0,
            last_delivered: None,
            gone: false,
            queries_fail: false,
            facts: Facts::default(),
        })))
    }

    /// Whether nothing is mapped or streaming.
    pub fn is_clean(&self) -> bool {
        let state = self.0.borrow();
        state.mapped == 0 && (state.gone || !state.streaming && state.buffers.is_empty())
    }
}

impl State {
    /// Returns a pseudo-random number (xorshift64, Marsaglia 2003).
    pub fn random(&mut self) -> u64 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        self.random
    }

    /// Returns true with this probability.
    pub fn random_bool(&mut self, probability: f64) -> bool {
        ((self.random() >> 11) as f64 / (1u64 << 53) as f64) < probability
    }

    /// Starts any ioctl: fails if the device is gone, or at random as if a signal had interrupted it.
    fn start_ioctl(&mut self) -> io::Result<()> {
        if self.gone {
            return error(ENODEV);
        }
        if self.random_bool(self.chances.interrupted) { error(EINTR) } else { Ok(()) }
    }

    /// Fails at random, with one of `errnos`.
    fn fail_randomly(&mut self, errnos: &[i32]) -> io::Result<()> {
        if self.random_bool(self.chances.refused) {
            let which = self.random() as usize % errnos.len();
            return error(errnos[which]);
        }
        Ok(())
    }

    /// Counts the buffers that the kernel has, filled or to be filled.
    pub fn queued_buffers(&self) -> usize {
        self.buffers.iter().filter(|buffer| **buffer != Buffer::Dequeued).count()
    }

    /// Advances one period, in which the camera fills the oldest empty buffer, if there is one.
    pub fn capture_frame(&mut self) {
        self.clock.advance_ns(PERIOD_NS);
        self.sequence += 1;
        if self.random_bool(self.chances.dropped) {
            return;
        }
        let Some(free) = self.order.iter().copied().find(|index| self.buffers[*index as usize] == Buffer::Queued)
        else {
            return;
        };
        let damaged = self.random_bool(self.chances.damaged);
        let flagged = damaged && self.random_bool(0.5);
        let used_bytes = if damaged && !flagged { self.random() as usize % PLANE_BYTES } else { PLANE_BYTES };
        self.buffers[free as usize] = Buffer::Done { sequence: self.sequence - 1, flagged, used_bytes };
    }

    /// The buffer to dequeue next, if it is filled.
    fn next_filled(&self) -> Option<u32> {
        self.order.front().copied().filter(|index| matches!(self.buffers[*index as usize], Buffer::Done { .. }))
    }
}

impl Kernel for Model {
    type Memory = Memory;

    fn request_buffers(&mut self, count: u32) -> io::Result<u32> {
        let mut state = self.0.borrow_mut();
        assert!(count > 0 || state.mapped == 0, "buffers are freed while {} planes are mapped", state.mapped);
        assert!(!state.streaming || state.gone, "buffers are asked for while the stream runs");
        state.start_ioctl()?;
        if count > 0 {
            state.fail_randomly(&[EBUSY, EINVAL])?;
        }
        let granted = count.min(state.granted);
        state.buffers = vec![Buffer::Dequeued; granted as usize];
        state.order.clear();
        Ok(granted)
    }

    fn query_buffer(&mut self, index: u32) -> io::Result<BufferInfo> {
        let mut state = self.0.borrow_mut();
        state.start_ioctl()?;
        if state.queries_fail {
            return error(EIO);
        }
        let in_kernel = state.buffers[index as usize] != Buffer::Dequeued;
        let span = |plane: u64| Span { offset: u64::from(index) * 8 + plane, length_bytes: PLANE_BYTES };
        let mut planes = [Span::default(); MAX_PLANES];
        (planes[0], planes[1]) = (span(0), span(1));
        Ok(BufferInfo { planes, plane_count: 2, in_kernel })
    }

    fn map_plane(&mut self, span: Span) -> io::Result<Memory> {
        let mut state = self.0.borrow_mut();
        state.start_ioctl()?;
        assert!(span.offset / 8 < state.buffers.len() as u64 && span.length_bytes == PLANE_BYTES);
        state.mapped += 1;
        drop(state);
        Ok(Memory { bytes: [0; PLANE_BYTES], model: Rc::clone(&self.0) })
    }

    fn queue_buffer(&mut self, index: u32) -> io::Result<()> {
        let mut state = self.0.borrow_mut();
        state.start_ioctl()?;
        assert_eq!(state.buffers[index as usize], Buffer::Dequeued, "buffer {index} is queued twice");
        state.fail_randomly(&[EINVAL, EIO])?;
        state.buffers[index as usize] = Buffer::Queued;
        state.order.push_back(index);
        state.facts.max_queued = state.facts.max_queued.max(state.order.len());
        Ok(())
    }

    fn dequeue_buffer(&mut self) -> io::Result<Dequeued> {
        let mut state = self.0.borrow_mut();
        state.start_ioctl()?;
        if !state.streaming {
            return error(EINVAL);
        }
        let chances = state.chances;
        if state.random_bool(chances.gone) {
            state.gone = true;
            return error(ENODEV);
        }
        let Some(index) = state.next_filled() else { return error(EAGAIN) };
        if state.random_bool(chances.refused) {
            if state.random_bool(0.5) {
                // The error consumes a buffer, as it may with a real driver.
                state.order.pop_front();
                state.buffers[index as usize] = Buffer::Dequeued;
            }
            return error(EIO);
        }
        state.order.pop_front();
        let Buffer::Done { sequence, flagged, used_bytes } =
            std::mem::replace(&mut state.buffers[index as usize], Buffer::Dequeued)
        else {
            unreachable!("it was done");
        };
        state.facts.delivered += 1;
        state.facts.damaged += u64::from(flagged || used_bytes < PLANE_BYTES);
        let last = state.last_delivered.replace(sequence);
        state.facts.missed += last.map_or(0, |last| u64::from(sequence - last - 1));
        let mut filled = [ByteRange::default(); MAX_PLANES];
        filled[0] = ByteRange { start: 0, end: PLANE_BYTES };
        filled[1] = ByteRange { start: 0, end: used_bytes };
        let stamp_ns = Some(1_000_000 + u64::from(sequence) * PERIOD_NS);
        Ok(Dequeued { index, sequence, stamp_ns, flagged, filled })
    }

    fn stream_on(&mut self) -> io::Result<()> {
        let mut state = self.0.borrow_mut();
        state.start_ioctl()?;
        let idle = state.buffers.iter().filter(|buffer| **buffer != Buffer::Queued).count();
        assert_eq!(idle, 0, "the stream starts with {idle} buffers that are not queued");
        state.fail_randomly(&[ENOSPC, EINVAL])?;
        (state.streaming, state.sequence, state.last_delivered) = (true, 0, None);
        state.facts.starts += 1;
        Ok(())
    }

    fn stream_off(&mut self) -> io::Result<()> {
        let mut state = self.0.borrow_mut();
        state.start_ioctl()?;
        state.streaming = false;
        state.buffers.fill(Buffer::Dequeued);
        state.order.clear();
        Ok(())
    }

    fn wait(&mut self, timeout: Duration) -> io::Result<Wake> {
        let mut state = self.0.borrow_mut();
        if state.gone {
            return Ok(Wake::Error);
        }
        state.clock.advance_ns(1000);
        state.start_ioctl()?;
        let until_ns = state.clock.now_ns() + timeout.as_nanos() as u64;
        if !state.streaming {
            return Ok(Wake::Error);
        }
        // The caller may have been busy for a few frames.
        for _ in 0..state.random() % 4 {
            state.capture_frame();
        }
        while state.next_filled().is_none() {
            if state.clock.now_ns() >= until_ns {
                return Ok(Wake::TimedOut);
            }
            state.capture_frame();
        }
        Ok(Wake::Filled)
    }
}
