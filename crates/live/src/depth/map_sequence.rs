//! Depth maps in files of their own, paired with the frames by their number.

use bokehcam::calibration::registration::AnySizeRegistration;
use bokehcam::depth::{DepthError, DepthSource, FrameInput};
use bokehcam::frame::DepthMap;
use bokehcam_media::recording::map_sequence::MapSequence;

/// Reads the depth of each frame from the map of the same number.
pub struct SequenceDepth {
    maps: MapSequence,
    /// For maps of another camera's view.
    registration: Option<AnySizeRegistration>,
}

impl SequenceDepth {
    /// Creates a source of these maps, which are registered if there is a `registration`.
    pub fn new(maps: MapSequence, registration: Option<AnySizeRegistration>) -> Self {
        Self { maps, registration }
    }
}

impl DepthSource for SequenceDepth {
    fn read(&mut self, FrameInput { stamp, color, .. }: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
        match &mut self.registration {
            Some(registration) => registration.register(&self.maps.read_unfitted(stamp.index)?.map, map),
            None => *map = self.maps.read(stamp.index, color.size())?.map,
        }
        Ok(())
    }
}
