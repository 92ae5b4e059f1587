//! Why a queue cannot be used.

use std::io;

use super::{BUFFERS, LEAST_BUFFERS};

/// Why a queue cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum QueueError {
    #[error("{step}: {source}")]
    Refused {
        /// What was asked for.
        step: &'static str,
        source: io::Error,
    },
    /// Too few to read one while another is filled.
    #[error("the driver gives {granted} of {BUFFERS} buffers, and {LEAST_BUFFERS} are needed")]
    TooFewBuffers {
        /// As many as there are.
        granted: u32,
    },
    /// A driver that breaks the rules.
    #[error("the driver gave back buffer {0}, which it did not have")]
    Foreign(u32),
}

impl QueueError {
    pub(super) fn at(step: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Refused { step, source }
    }

    /// What the driver said, where it said something.
    pub fn source(&self) -> Option<&io::Error> {
        match self {
            Self::Refused { source, .. } => Some(source),
            _ => None,
        }
    }
}
