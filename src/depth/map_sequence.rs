//! Depth maps in files of their own, paired with the frames by their number.

use super::{DepthError, DepthSource, FrameInput};
use crate::frame::DepthMap;
use crate::recording::map_sequence::MapSequence;

/// Reads the depth of each frame from the map of the same number.
pub struct SequenceDepth(pub MapSequence);

impl DepthSource for SequenceDepth {
    fn read(&mut self, FrameInput { stamp, color, .. }: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
        *map = self.0.read(stamp.index, color.size())?.map;
        Ok(())
    }
}
