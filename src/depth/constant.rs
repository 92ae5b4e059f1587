//! A constant depth map for every frame, as for a photo.

use super::{DepthError, DepthSource, FrameInput};
use crate::frame::DepthMap;

/// Returns the same depth map for every frame.
pub struct ConstantDepth(pub DepthMap);

impl DepthSource for ConstantDepth {
    fn read(&mut self, _: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
        map.resize(self.0.width, self.0.height);
        map.metres.copy_from_slice(&self.0.metres);
        Ok(())
    }
}
