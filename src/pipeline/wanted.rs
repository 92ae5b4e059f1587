//! Where blurred pictures are wanted (in memory, on the GPU, or both), and whether each needs depth of its own.

use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};

use crate::compute::Place;

const PLACES: [Place; 3] = [Place::Memory, Place::Device, Place::Both];

/// A request that may change during a run; frames in flight keep to the previous one.
#[derive(Debug, Default)]
pub struct Wanted {
    place: AtomicU8,
    /// Whether pictures are needed in memory in addition.
    needed: AtomicBool,
    own_depth: AtomicBool,
}

impl Wanted {
    /// Creates a request for pictures in `place`.
    pub fn new(place: Place) -> Self {
        Self { place: AtomicU8::new(place as u8), ..Self::default() }
    }

    /// Sets where pictures are wanted.
    pub fn set(&self, place: Place) {
        self.place.store(place as u8, Ordering::Relaxed);
    }

    /// Sets whether pictures are needed in memory in addition.
    pub fn need(&self, needed: bool) {
        self.needed.store(needed, Ordering::Relaxed);
    }

    /// Sets whether each frame must have depth of its own, however little time there is.
    pub fn want_own_depth(&self, own: bool) {
        self.own_depth.store(own, Ordering::Relaxed);
    }

    /// Returns whether each frame must have depth of its own.
    pub fn wants_own_depth(&self) -> bool {
        self.own_depth.load(Ordering::Relaxed)
    }

    /// Returns where pictures are wanted.
    pub fn place(&self) -> Place {
        match PLACES[usize::from(self.place.load(Ordering::Relaxed))] {
            Place::Device if self.needed.load(Ordering::Relaxed) => Place::Both,
            place => place,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wish_is_what_was_set() {
        let wanted = Wanted::default();
        assert_eq!(wanted.place(), Place::Memory);
        for place in PLACES {
            wanted.set(place);
            assert_eq!((wanted.place(), Wanted::new(place).place()), (place, place));
            wanted.need(true);
            assert_eq!(wanted.place(), if place == Place::Device { Place::Both } else { place });
            wanted.need(false);
        }
    }
}
