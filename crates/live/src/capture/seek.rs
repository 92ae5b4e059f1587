//! Seeking in a recording while it plays.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

use bokehcam::frame::Stamp;
use bokehcam::link::demand::Demand;

/// State shared by the camera and its controls: the frames of the recording, and which one is requested next.
#[derive(Debug)]
pub struct Seeker {
    /// The source's own index of the first frame.
    first: usize,
    /// Time of each frame, relative to the first; never empty.
    times_ns: Box<[u64]>,
    /// Time of the end of the last frame.
    length_ns: u64,
    /// The newest request: its number in the upper half, the frame's position in the lower half.
    request: AtomicU64,
    /// Wakes the camera on a request.
    demand: OnceLock<Demand>,
}

/// A request to show a frame next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SeekRequest {
    /// Number of the request, from 1.
    pub number: u64,
    /// Position of the frame, from 0.
    pub position: usize,
}

const POSITION_BITS: u32 = 32;

impl Seeker {
    /// Creates a seeker for frames at these times after the first one, whose index is `first`; the last one ends at
    /// `length_ns`.
    pub(super) fn new(first: usize, times_ns: Box<[u64]>, length_ns: u64) -> Self {
        Self { first, times_ns, length_ns, request: AtomicU64::new(0), demand: OnceLock::new() }
    }

    /// Returns the number of frames, at least 1.
    pub fn frames(&self) -> usize {
        self.times_ns.len()
    }

    /// Returns the time from the first frame to the end of the last, in nanoseconds.
    pub fn length_ns(&self) -> u64 {
        self.length_ns
    }

    /// Returns the time of the frame at a position, in nanoseconds after the first one; clamped to the last frame.
    pub fn time_ns(&self, position: usize) -> u64 {
        self.times_ns[position.min(self.times_ns.len() - 1)]
    }

    /// Returns the position of a delivered frame.
    pub fn position_of(&self, stamp: Stamp) -> usize {
        stamp.index.saturating_sub(self.first)
    }

    /// Requests the frame at this position, clamped to the last one, as the next one; it is delivered even if no client
    /// watches. A newer request replaces an older one. Returns the number of the request.
    pub fn request_frame(&self, position: usize) -> u64 {
        let position = position.min(self.times_ns.len() - 1) as u64;
        let request = |previous: u64| Some((((previous >> POSITION_BITS) + 1) << POSITION_BITS) | position);
        let previous =
            self.request.fetch_update(Ordering::Relaxed, Ordering::Relaxed, request).unwrap_or_else(|same| same);
        if let Some(demand) = self.demand.get() {
            demand.notify();
        }
        (previous >> POSITION_BITS) + 1
    }

    /// Returns the newest request, if its number is above `last`.
    pub fn newer_request(&self, last: u64) -> Option<SeekRequest> {
        let request = self.request.load(Ordering::Relaxed);
        let request =
            SeekRequest { number: request >> POSITION_BITS, position: (request & u64::from(u32::MAX)) as usize };
        Some(request).filter(|request| request.number > last)
    }

    /// Sets the demand that a request signals, which wakes its waiting thread.
    pub fn set_demand(&self, demand: &Demand) {
        // Set once: a camera runs only once.
        let _ = self.demand.set(demand.clone());
    }
}
