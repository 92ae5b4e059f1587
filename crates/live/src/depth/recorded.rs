//! Depth from a recording, decoded on the depth thread while the next picture is decoded on the capture thread.

use std::sync::Arc;

use bokehcam::depth::{DepthError, DepthSource, FrameInput};
use bokehcam::frame::DepthMap;
use bokehcam_media::recording::{Recording, Scratch};

/// The depth pictures of a recording.
pub struct RecordedDepth {
    recording: Arc<Recording>,
    scratch: Scratch,
}

impl RecordedDepth {
    /// Reads the depth of `recording`, which messages call `name`.
    ///
    /// # Errors
    /// Fails if the recording has no depth.
    pub fn new(recording: Arc<Recording>, name: &str) -> Result<Self, DepthError> {
        if recording.has_depth() {
            Ok(Self { recording, scratch: Scratch::default() })
        } else {
            Err(DepthError::NoDepth { source_name: name.to_owned() })
        }
    }
}

impl DepthSource for RecordedDepth {
    fn read(&mut self, FrameInput { stamp, .. }: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
        Ok(self.recording.read_depth(stamp.index, &mut self.scratch, map)?)
    }
}
