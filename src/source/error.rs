//! Why a source cannot be opened.

use std::io;
use std::path::PathBuf;

use crate::calibration::CalibrationError;
use crate::capture::CaptureError;
use crate::depth::DepthError;
use crate::files::input;
use crate::recording::RecordingError;

/// Why a source cannot be opened.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// What is asked for does not make sense together.
    #[error("{0}")]
    Usage(String),
    /// What is named is not here (or more of it than one), which the machine decides and not the name: a camera that is not
    /// plugged in, a disk that is not mounted, a network that is not installed.
    #[error("{0}")]
    NotThere(String),
    /// The calibration of a depth camera cannot be used.
    #[error("{}:{line}: {what}", path.display())]
    Registration {
        path: PathBuf,
        line: usize,
        /// What is wrong, and what is accepted.
        what: String,
    },
    /// A file cannot be read.
    #[error("{}: {}", path.display(), input::said(source))]
    Io { path: PathBuf, source: io::Error },
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// It is no recording, or a faulty one.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// There is no depth.
    #[error(transparent)]
    Depth(#[from] DepthError),
    /// The calibration of two eyes cannot be used.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// The depth camera cannot be opened.
    #[cfg(feature = "camera")]
    #[error("--depth: {0}")]
    DepthCamera(#[from] crate::v4l2::live::OpenError),
}

impl SourceError {
    /// Whether the caller has to write something differently: the same words will not become right by themselves.
    pub fn is_wrong_argument(&self) -> bool {
        matches!(self, Self::Usage(_) | Self::Registration { .. })
    }

    /// The same, said of what is called `name`.
    #[must_use]
    pub fn of(self, name: &str) -> Self {
        match self {
            Self::Usage(what) => Self::Usage(format!("{name}: {what}")),
            Self::NotThere(what) => Self::NotThere(format!("{name}: {what}")),
            other => other,
        }
    }

    pub(super) fn usage<T>(what: impl Into<String>) -> Result<T, Self> {
        Err(Self::Usage(what.into()))
    }
}
