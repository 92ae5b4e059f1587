//! Where depth comes from, and what is made of it before the blur: a focus distance ([`focus`]), a map without
//! holes ([`fill`]), and, for depth that was measured, one that agrees with the picture ([`refine`]); whether it does
//! before that is measured, too ([`agreement`]).

pub mod agreement;
mod alignment;
pub mod backdrop;
pub mod background;
#[cfg(feature = "files")]
pub mod beside;
mod bits;
pub mod defocus;
mod dilation;
pub mod fill;
pub mod focus;
pub mod follow;
mod guided_fill;
pub mod kept;
#[cfg(feature = "camera")]
pub mod live;
pub mod matting;
pub mod misfit;
pub mod motion;
pub mod plate;
#[cfg(feature = "files")]
pub mod recorded;
mod reduced;
pub mod refine;
pub mod registration;
#[cfg(feature = "networks")]
pub mod single_camera;
pub mod stereo;
mod tap;

use crate::frame::{ColorImage, DepthMap, GrayImage, Stamp};
#[cfg(feature = "files")]
use crate::recording::RecordingError;

/// Gives each frame its depth.
///
/// Cameras that know the depth of their frames themselves hand it over with the picture and need no source.
pub trait DepthSource: Send {
    /// Gives a picture the geometry of its depth, in place: called with every frame, before [`DepthSource::read`] where
    /// that is called at all. Most depth is that of the picture as it is.
    fn rectify(&mut self, color: &mut ColorImage) {
        let _ = color;
    }

    /// The depth of the frame `seen`, into `map` (resized to fit).
    ///
    /// # Errors
    /// There is none, or it cannot be read; `map` is then unspecified.
    fn read(&mut self, seen: Seen, map: &mut DepthMap) -> Result<(), DepthError>;

    /// What a map costs at each of its efforts, relative to the last and finest, which is 1; ascending. A source without
    /// a choice has one.
    fn efforts(&self) -> &'static [f64] {
        &[1.0]
    }

    /// Changes the effort, as its place in [`DepthSource::efforts`], from the next map on. It begins with the finest.
    fn set_effort(&mut self, effort: usize) {
        let _ = effort;
    }

    /// Whether later frames may be given its maps, moved with the picture. Not those whose outlines are a mask's: that is one of
    /// its frame alone, and what moves before all else is who it is of.
    fn may_be_shared(&self) -> bool {
        true
    }

    /// Whether its maps have all that is behind the nearer surface, so that nothing need be remembered.
    fn knows_background(&self) -> bool {
        false
    }

    /// Whether the lens is focused on whom it finds, from the next map on; where it is not, nobody need be found.
    fn look_for_persons(&mut self, on: bool) {
        let _ = on;
    }

    /// Another scene comes, as somebody went back or forth in the source: its own time is ahead of media time by so many
    /// nanoseconds from now on.
    fn jump(&mut self, ahead_ns: i64) {
        let _ = ahead_ns;
    }

    /// No frame came for a while: lets go of the device, if there is one, until [`DepthSource::read`] is called again.
    fn rest(&mut self) {}
}

/// A frame, as far as its depth may depend on it.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// Which frame, and when.
    pub stamp: Stamp,
    /// Its picture; of two eyes the left one's.
    pub color: &'a ColorImage,
    /// What the right eye saw, where there is one.
    pub right: Option<&'a GrayImage>,
}

/// Why a frame has no depth.
#[derive(Debug, thiserror::Error)]
pub enum DepthError {
    /// The recording's depth picture cannot be read.
    #[cfg(feature = "files")]
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A depth camera has given no map yet. Later frames may have one.
    #[error("{source_name}: no depth yet")]
    Unpaired {
        /// The camera.
        source_name: String,
    },
    /// The two eyes do not match.
    #[error(transparent)]
    Match(#[from] stereo::MatchError),
    /// A frame came without what the right eye saw.
    #[error("{source_name}: this frame has no right eye")]
    OneEye {
        /// Where the frames come from.
        source_name: String,
    },
    /// A network cannot be loaded.
    #[cfg(feature = "networks")]
    #[error(transparent)]
    Load(#[from] crate::network::NetworkError),
    /// A network failed.
    #[error("{name}: {why}")]
    Network {
        /// Its file.
        name: String,
        /// What failed.
        why: String,
    },
    /// A plate cannot be used.
    #[error("{name}: {why}")]
    Plate {
        /// Its file.
        name: String,
        /// Why not.
        why: String,
    },
    /// There is no depth at all.
    #[error("the effect dof needs depth, and {source_name} has none; use --effect blur or tilt-shift")]
    NoDepth {
        /// Where the frames come from.
        source_name: String,
    },
}
