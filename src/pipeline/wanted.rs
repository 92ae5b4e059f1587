//! Where blurred pictures are wanted: in memory, on the GPU that blurs, or both.

use std::sync::atomic::{AtomicU8, Ordering};

use crate::compute::Place;

const PLACES: [Place; 3] = [Place::Memory, Place::Device, Place::Both];

/// A wish that may change while a run goes on; frames that are blurred already keep to the one before.
#[derive(Debug, Default)]
pub struct Wanted(AtomicU8);

impl Wanted {
    /// Where pictures are wanted.
    pub fn new(place: Place) -> Self {
        Self(AtomicU8::new(place as u8))
    }

    /// Where they are wanted from now on.
    pub fn set(&self, place: Place) {
        self.0.store(place as u8, Ordering::Relaxed);
    }

    /// Where they are wanted now.
    pub fn place(&self) -> Place {
        PLACES[usize::from(self.0.load(Ordering::Relaxed))]
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
        }
    }
}
