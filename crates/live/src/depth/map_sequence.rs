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
    /// Width and height of the pictures that the maps are of.
    color_px: (u32, u32),
}

impl SequenceDepth {
    /// Creates a source of these maps of pictures of `color_px`, which are registered if there is a `registration`.
    pub fn new(maps: MapSequence, registration: Option<AnySizeRegistration>, color_px: (u32, u32)) -> Self {
        Self { maps, registration, color_px }
    }
}

impl DepthSource for SequenceDepth {
    fn read(&mut self, FrameInput { stamp, .. }: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
        match &mut self.registration {
            Some(registration) => registration.register(&self.maps.read_unfitted(stamp.index)?.map, map),
            None => *map = self.maps.read(stamp.index, self.color_px)?.map,
        }
        Ok(())
    }
}
