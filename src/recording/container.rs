//! Recordings in a single file, whose pictures are parts of it.

use std::fmt::Debug;
use std::path::Path;

use super::contents::PictureSource;
use super::decode::Scratch;
use super::error::RecordingError;
use super::fault::PictureFault;
use super::{kinect, mcap, record3d};
use crate::frame::{ColorImage, DepthMap};

/// The pictures of such a recording, by the number of their frame, which must exist. Several threads may read at once.
pub(super) trait Container: Debug + Send + Sync {
    /// Reads width and height of a colour picture from its header.
    fn read_size(&self, frame: usize) -> Result<(u32, u32), PictureFault>;

    /// Reads a colour picture. Rejects one whose size is not `expected`.
    fn read_color(
        &self,
        frame: usize,
        expected: (u32, u32),
        scratch: &mut Scratch,
        into: &mut ColorImage,
    ) -> Result<(), PictureFault>;

    /// Reads depth in metres, 0 = unknown. Rejects a map that does not cover the view of a picture of `size`: that of the
    /// colour camera, or of the depth camera if there is a calibration.
    fn read_depth(
        &self,
        frame: usize,
        size: (u32, u32),
        scratch: &mut Scratch,
        into: &mut DepthMap,
    ) -> Result<(), PictureFault>;
}

/// Returns the size of the first colour picture with a readable header, or else the error of the first one. `sources`
/// names the colour pictures of all frames.
pub(super) fn read_first_size<'a>(
    container: &dyn Container,
    file: &Path,
    sources: impl Iterator<Item = &'a PictureSource>,
) -> Result<(u32, u32), RecordingError> {
    let mut first_error = None;
    for (frame, source) in sources.enumerate() {
        match container.read_size(frame) {
            Ok(size) => return Ok(size),
            Err(fault) => first_error = first_error.or(Some(source.error(file, fault))),
        }
    }
    Err(first_error.unwrap_or_else(|| RecordingError::EmptyList { list: file.to_owned() }))
}

/// Returns whether a file is a recording by itself.
pub fn is_recording_file(path: &Path) -> bool {
    path.is_file() && [mcap::LAYOUT, record3d::LAYOUT, kinect::LAYOUT].iter().any(|layout| (layout.matches)(path))
}
