//! A recording that is written, in any layout that can be.

use std::path::Path;

use super::error::RecordingError;
use super::frame_sequence::RecordingSummary;
use super::tum::WriterOptions;
use super::{mcap, tum};
use bokehcam::frame::{ColorImage, DepthMap};

/// Writes a recording frame by frame: a folder in the TUM RGB-D layout, or an MCAP file.
pub enum RecordingWriter {
    /// See [`tum::Writer`].
    Folder(tum::Writer),
    /// See [`mcap::Writer`].
    Mcap(mcap::Writer),
}

impl RecordingWriter {
    /// Starts a recording at `to`: an MCAP file if its name ends so and it is not a folder, else a folder. `overwrite`
    /// allows to replace an existing recording, once the new one is complete.
    ///
    /// # Errors
    /// Same as for [`tum::Writer::create`] and [`mcap::Writer::create`].
    pub fn create(to: &Path, overwrite: bool) -> Result<Self, RecordingError> {
        let is_mcap = to.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("mcap"));
        match is_mcap && !to.is_dir() {
            true => mcap::Writer::create(to, overwrite).map(Self::Mcap),
            false => {
                let options = WriterOptions { overwrite, ..WriterOptions::default() };
                tum::Writer::create(to, &options).map(Self::Folder)
            }
        }
    }

    /// Adds a frame at `time_ns`, in nanoseconds of any clock.
    ///
    /// # Errors
    /// Same as for [`tum::Writer::add`].
    pub fn add(&mut self, time_ns: u64, color: &ColorImage, depth: Option<&DepthMap>) -> Result<(), RecordingError> {
        match self {
            Self::Folder(writer) => writer.add(time_ns, color, depth),
            Self::Mcap(writer) => writer.add(time_ns, color, depth),
        }
    }

    /// Returns the number of frames so far.
    pub fn frames(&self) -> usize {
        match self {
            Self::Folder(writer) => writer.frames(),
            Self::Mcap(writer) => writer.frames(),
        }
    }

    /// Returns the largest depth that can be written, in metres.
    pub fn max_depth_m(&self) -> f32 {
        match self {
            Self::Folder(writer) => writer.max_depth_m(),
            Self::Mcap(writer) => writer.max_depth_m(),
        }
    }

    /// Completes the recording.
    ///
    /// # Errors
    /// Same as for [`tum::Writer::finish`].
    pub fn finish(self) -> Result<RecordingSummary, RecordingError> {
        match self {
            Self::Folder(writer) => writer.finish(),
            Self::Mcap(writer) => writer.finish(),
        }
    }

    /// Ends a recording that was interrupted, and keeps it.
    ///
    /// # Errors
    /// Same as for [`tum::Writer::finish_incomplete`].
    pub fn finish_incomplete(self) -> Result<RecordingSummary, RecordingError> {
        match self {
            Self::Folder(writer) => writer.finish_incomplete(),
            Self::Mcap(writer) => writer.finish_incomplete(),
        }
    }
}
