//! Errors of opening a source.

use std::error::Error;
use std::io;
use std::path::PathBuf;

use crate::capture::CaptureError;
use bokehcam::calibration::CalibrationError;
use bokehcam::depth::DepthError;
use bokehcam_files::input;
use bokehcam_media::recording::RecordingError;

/// An error in opening a source.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// The options contradict each other.
    #[error("{0}")]
    Usage(String),
    /// The named thing is missing on this machine, or ambiguous: a camera that is not plugged in, a disk that is not
    /// mounted, a network that is not installed. The same name may be right later.
    #[error("{0}")]
    NotFound(String),
    /// The calibration of a depth camera is invalid.
    #[error("{}:{line}: {what}", path.display())]
    Registration {
        path: PathBuf,
        line: usize,
        /// What is wrong, and what is accepted.
        what: String,
    },
    /// A file cannot be read.
    #[error("{}: {}", path.display(), input::format_io_error(source))]
    Io { path: PathBuf, source: io::Error },
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// The folder is not a recording, or a faulty one.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// Depth is not available.
    #[error(transparent)]
    Depth(#[from] DepthError),
    /// The calibration of a stereo pair is invalid.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// The depth camera cannot be opened.
    #[error("--depth: {0}")]
    DepthCamera(Box<dyn Error + Send + Sync>),
}

impl SourceError {
    /// Returns whether the arguments must be changed: the same ones would never succeed.
    pub fn is_wrong_argument(&self) -> bool {
        matches!(self, Self::Usage(_) | Self::Registration { .. })
    }

    /// Prefixes the message with `name`.
    #[must_use]
    pub fn with_prefix(self, name: &str) -> Self {
        match self {
            Self::Usage(what) => Self::Usage(format!("{name}: {what}")),
            Self::NotFound(what) => Self::NotFound(format!("{name}: {what}")),
            other => other,
        }
    }

    pub(super) fn usage_error<T>(what: impl Into<String>) -> Result<T, Self> {
        Err(Self::Usage(what.into()))
    }
}
