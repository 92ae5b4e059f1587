//! Going back and forth in a recording while it is played.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::frame::Stamp;
use crate::link::demand::Demand;

/// What those who go back and forth share with the camera: which frames there are, and which one is wanted next.
#[derive(Debug)]
pub struct Seeker {
    /// The source's own number of the first frame.
    first: usize,
    /// When each frame is, from the first one; there is one at least.
    times_ns: Box<[u64]>,
    /// To the end of the last one.
    length_ns: u64,
    /// The newest wish: its number in the upper half, the place of the frame in the lower one.
    wish: AtomicU64,
    /// What is rung at a wish.
    demand: OnceLock<Demand>,
}

/// A frame that is wanted next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wish {
    /// Counts from 1.
    pub number: u64,
    /// The place of the frame, from 0.
    pub place: usize,
}

const HALF: u32 = 32;

impl Seeker {
    /// For frames at these times after the first one, which has the number `first`; all end after `length_ns`.
    pub(super) fn new(first: usize, times_ns: Box<[u64]>, length_ns: u64) -> Self {
        Self { first, times_ns, length_ns, wish: AtomicU64::new(0), demand: OnceLock::new() }
    }

    /// How many frames there are: 1 at least.
    pub fn frames(&self) -> usize {
        self.times_ns.len()
    }

    /// From the first frame to the end of the last, in nanoseconds.
    pub fn length_ns(&self) -> u64 {
        self.length_ns
    }

    /// When the frame at a place is, in nanoseconds after the first one; beyond the last one, when that is.
    pub fn time_ns(&self, place: usize) -> u64 {
        self.times_ns[place.min(self.times_ns.len() - 1)]
    }

    /// The place of a frame that came.
    pub fn place_of(&self, stamp: Stamp) -> usize {
        stamp.index.saturating_sub(self.first)
    }

    /// Wants the frame at this place next, or the last one there is; it comes although nobody watches. Of several wishes the
    /// newest counts. Returns its number.
    pub fn go_to(&self, place: usize) -> u64 {
        let place = place.min(self.times_ns.len() - 1) as u64;
        let wish = |before: u64| Some((((before >> HALF) + 1) << HALF) | place);
        let before = self.wish.fetch_update(Ordering::Relaxed, Ordering::Relaxed, wish).unwrap_or_else(|same| same);
        if let Some(demand) = self.demand.get() {
            demand.ring();
        }
        (before >> HALF) + 1
    }

    /// The newest wish, if there is one after number `last`.
    pub fn wish_after(&self, last: u64) -> Option<Wish> {
        let wish = self.wish.load(Ordering::Relaxed);
        let wish = Wish { number: wish >> HALF, place: (wish & u64::from(u32::MAX)) as usize };
        Some(wish).filter(|wish| wish.number > last)
    }

    /// Whoever sleeps for want of this demand is woken by a wish.
    pub fn wake(&self, demand: &Demand) {
        // A camera is run once.
        let _ = self.demand.set(demand.clone());
    }
}
