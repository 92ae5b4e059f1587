//! Why a queue cannot be used.

use std::io;

use super::{BUFFERS, MIN_BUFFERS};

/// Why a queue cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum QueueError {
    #[error("{step}: {source}")]
    Refused { step: &'static str, source: io::Error },
    /// Too few to read one while another is filled.
    #[error("the driver gives {granted} of {BUFFERS} buffers, but at least {MIN_BUFFERS} are needed")]
    TooFewBuffers { granted: u32 },
    /// The driver violated the V4L2 protocol.
    #[error("the driver gave back buffer {0}, which it did not have")]
    Foreign(u32),
}

impl QueueError {
    pub(super) fn refused_at(step: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Refused { step, source }
    }

    /// Returns the system error, if there is one.
    pub fn source(&self) -> Option<&io::Error> {
        match self {
            Self::Refused { source, .. } => Some(source),
            _ => None,
        }
    }
}
