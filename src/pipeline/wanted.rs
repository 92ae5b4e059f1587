//! Where blurred pictures are wanted: in memory, on the GPU that blurs, or both; and whether with depth of their own.

use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};

use crate::compute::Place;

const PLACES: [Place; 3] = [Place::Memory, Place::Device, Place::Both];

/// A wish that may change while a run goes on; frames that are blurred already keep to the one before.
#[derive(Debug, Default)]
pub struct Wanted {
    place: AtomicU8,
    /// Whether somebody needs them in memory, wherever else they are wanted.
    needed: AtomicBool,
    own_depth: AtomicBool,
}

impl Wanted {
    /// Where pictures are wanted.
    pub fn new(place: Place) -> Self {
        Self { place: AtomicU8::new(place as u8), ..Self::default() }
    }

    /// Where they are wanted from now on.
    pub fn set(&self, place: Place) {
        self.place.store(place as u8, Ordering::Relaxed);
    }

    /// Whether they are needed in memory from now on, besides.
    pub fn need(&self, needed: bool) {
        self.needed.store(needed, Ordering::Relaxed);
    }

    /// Whether each frame is to have depth of its own from now on, however little time there is.
    pub fn want_own_depth(&self, own: bool) {
        self.own_depth.store(own, Ordering::Relaxed);
    }

    /// Whether it is now.
    pub fn wants_own_depth(&self) -> bool {
        self.own_depth.load(Ordering::Relaxed)
    }

    /// Where they are wanted now.
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
