//! Where blurred pictures are wanted (in memory, on the GPU, or both), and whether each needs depth of its own.

use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};

use bokehcam::compute::PictureLocation;

const PLACES: [PictureLocation; 3] = [PictureLocation::Memory, PictureLocation::Device, PictureLocation::Both];

/// A request that may change during a run; frames in flight keep to the previous one.
#[derive(Debug, Default)]
pub struct OutputRequest {
    place: AtomicU8,
    /// Whether pictures are needed in memory in addition.
    needed: AtomicBool,
    own_depth: AtomicBool,
}

impl OutputRequest {
    /// Creates a request for pictures in `place`.
    pub fn new(place: PictureLocation) -> Self {
        Self { place: AtomicU8::new(place as u8), ..Self::default() }
    }

    /// Sets where pictures are wanted.
    pub fn set_place(&self, place: PictureLocation) {
        self.place.store(place as u8, Ordering::Relaxed);
    }

    /// Sets whether pictures are needed in memory in addition.
    pub fn set_needed_in_memory(&self, needed: bool) {
        self.needed.store(needed, Ordering::Relaxed);
    }

    /// Sets whether each frame must have depth of its own, however little time there is.
    pub fn require_own_depth(&self, own: bool) {
        self.own_depth.store(own, Ordering::Relaxed);
    }

    /// Returns whether each frame must have depth of its own.
    pub fn requires_own_depth(&self) -> bool {
        self.own_depth.load(Ordering::Relaxed)
    }

    /// Returns where pictures are wanted.
    pub fn place(&self) -> PictureLocation {
        match PLACES[usize::from(self.place.load(Ordering::Relaxed))] {
            PictureLocation::Device if self.needed.load(Ordering::Relaxed) => PictureLocation::Both,
            place => place,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wish_is_what_was_set() {
        let output_request = OutputRequest::default();
        assert_eq!(output_request.place(), PictureLocation::Memory);
        for place in PLACES {
            output_request.set_place(place);
            assert_eq!((output_request.place(), OutputRequest::new(place).place()), (place, place));
            output_request.set_needed_in_memory(true);
            assert_eq!(
                output_request.place(),
                if place == PictureLocation::Device { PictureLocation::Both } else { place }
            );
            output_request.set_needed_in_memory(false);
        }
    }
}
