//! Where depth comes from, and what is made of it before the blur: a focus distance ([`focus`]), a map without
//! holes ([`fill`]), and, for depth that was measured, one that agrees with the picture ([`refine`]).

pub mod beside;
mod claim;
pub mod fill;
pub mod focus;
#[cfg(feature = "camera")]
pub mod live;
pub mod recorded;
pub mod refine;
pub mod registration;
pub mod stereo;

use crate::frame::{DepthMap, Stamp};
use crate::recording::RecordingError;

/// Gives each frame its depth.
///
/// Cameras that know the depth of their frames themselves hand it over with the picture and need no source.
pub trait DepthSource: Send {
    /// The depth of the frame `stamp`, into `map` (resized to fit).
    ///
    /// # Errors
    /// There is none, or it cannot be read; `map` is then unspecified.
    fn read(&mut self, stamp: Stamp, map: &mut DepthMap) -> Result<(), DepthError>;

    /// No frame came for a while: lets go of the device, if there is one, until [`DepthSource::read`] is called again.
    fn rest(&mut self) {}
}

/// Why a frame has no depth.
#[derive(Debug, thiserror::Error)]
pub enum DepthError {
    /// The recording's depth picture cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A depth camera has given no map yet. Later frames may have one.
    #[error("{source_name}: no depth yet")]
    Unpaired {
        /// The camera.
        source_name: String,
    },
    /// There is no depth at all.
    #[error("the effect dof needs depth, and {source_name} has none; use --effect blur or tilt-shift")]
    NoDepth {
        /// Where the frames come from.
        source_name: String,
    },
}
