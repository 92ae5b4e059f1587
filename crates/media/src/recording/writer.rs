//! A recording that is written, in any layout that can be.

use std::path::{Path, PathBuf};

use super::error::{RecordingError, Result};
use super::frame_sequence::{FrameSequence, RecordingSummary};
use super::{mcap, tum};
use bokehcam::frame::{ColorImage, DepthMap};

/// How the frames of a recording are stored.
pub(super) trait Storage: Send + Sync {
    /// Stores frame `number`, from 0, which has `time_ns` of any clock.
    fn add(&mut self, number: usize, time_ns: u64, color: &ColorImage, depth: Option<&DepthMap>) -> Result<()>;

    /// Returns the largest depth that can be stored, in metres.
    fn max_depth_m(&self) -> f32;

    /// Completes the recording. Returns the number of files of an earlier one that are gone.
    fn finish(self: Box<Self>) -> Result<u64>;

    /// Ends a recording that was interrupted. Returns where it is.
    fn keep(self: Box<Self>) -> Result<PathBuf>;
}

/// Writes a recording frame by frame, with memory for one frame, or for one chunk of a file:
///
/// - a folder in the TUM RGB-D layout: `rgb/000000.png` (8-bit RGB), `depth/000000.png` (16-bit grey, 5000 units per metre,
///   0 = unknown) and so on. Its lists are finished last;
/// - or an MCAP file of ROS 2: `sensor_msgs/msg/CompressedImage` (PNG) for colour, `compressedDepth` (16-bit PNG in
///   millimetres, 0 = unknown) for depth, each with a `CameraInfo` that says that the camera is not calibrated.
///
/// An earlier recording stays until the new one is whole. [`RecordingWriter::finish`] or
/// [`RecordingWriter::finish_incomplete`] must end it; otherwise it cannot be read.
pub struct RecordingWriter {
    to: PathBuf,
    frames: FrameSequence,
    storage: Box<dyn Storage>,
}

impl RecordingWriter {
    /// Starts a recording at `to`: an MCAP file if its name ends so and it is not a folder, else a folder, which is created
    /// if needed. An unfinished recording of a killed process in that folder gets its lists first. `overwrite` allows to
    /// replace an existing file, or a recording of this program in the folder, once the new one is complete.
    ///
    /// # Errors
    /// The file or folder has content that may not be replaced; another process writes it, or it cannot be written.
    pub fn create(to: &Path, overwrite: bool) -> Result<Self> {
        let is_mcap = to.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("mcap"));
        let storage: Box<dyn Storage> = match is_mcap && !to.is_dir() {
            true => Box::new(mcap::Writer::create(to, overwrite)?),
            false => Box::new(tum::Writer::create(to, overwrite)?),
        };
        Ok(Self { to: to.to_owned(), frames: FrameSequence::default(), storage })
    }

    /// Adds a frame at `time_ns`, in nanoseconds of any clock. Readers skip a frame without depth if others have it.
    ///
    /// # Errors
    /// The frame does not fit the recording: its time is not after the last one, the size of the colour picture differs
    /// from the first, or the depth map does not cover it. Or a file cannot be written; a folder is unchanged then.
    pub fn add(&mut self, time_ns: u64, color: &ColorImage, depth: Option<&DepthMap>) -> Result<()> {
        self.frames.check(time_ns, color, depth)?;
        self.storage.add(self.frames.count(), time_ns, color, depth)?;
        self.frames.add(time_ns, color, depth, self.max_depth_m());
        Ok(())
    }

    /// Returns the number of frames so far.
    pub fn frames(&self) -> usize {
        self.frames.count()
    }

    /// Returns the largest depth that can be written, in metres; beyond, it is written as unknown.
    pub fn max_depth_m(&self) -> f32 {
        self.storage.max_depth_m()
    }

    /// Completes the recording, which gets its name; a replaced one is removed.
    ///
    /// # Errors
    /// No frame was added (an empty recording cannot be read), or it cannot be written.
    pub fn finish(self) -> Result<RecordingSummary> {
        self.check_not_empty()?;
        let replaced = self.storage.finish()?;
        Ok(RecordingSummary { replaced, ..self.frames.summary(&self.to) })
    }

    /// Ends a recording that was interrupted. If it was to replace an earlier one, that one stays, and the new one is kept
    /// beside it as `NAME.incomplete`, or `NAME.incomplete.mcap`. It can be read.
    ///
    /// # Errors
    /// Same as for [`RecordingWriter::finish`].
    pub fn finish_incomplete(self) -> Result<RecordingSummary> {
        self.check_not_empty()?;
        let kept = self.storage.keep()?;
        Ok(self.frames.summary(&kept))
    }

    fn check_not_empty(&self) -> Result<()> {
        if self.frames() > 0 { Ok(()) } else { Err(RecordingError::NothingRecorded { dir: self.to.clone() }) }
    }
}
