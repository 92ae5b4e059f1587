//! Depth sources, and the processing of depth maps before the blur: the focus distance ([`focus`]), hole filling
//! ([`fill`]), the refinement of measured depth against the picture ([`refine`]), and a measure of how well depth edges
//! match image edges ([`agreement`]).

pub mod agreement;
mod alignment;
pub mod backdrop;
pub mod background;
mod bitmap;
pub mod constant;
pub mod defocus;
pub mod dilation;
pub mod fill;
pub mod focus;
pub mod follow;
mod guided_fill;
pub mod hidden;
pub mod matting;
pub mod misalignment;
pub mod motion;
pub mod plate;
mod reduced;
pub mod refine;
pub mod stereo;
pub mod tap;
pub mod transformed;

use std::error::Error;

use crate::frame::{ColorImage, DepthMap, GrayImage, Stamp};

/// Provides the depth map of each frame.
///
/// Cameras that deliver depth together with the picture need no source.
pub trait DepthSource: Send {
    /// Rectifies a picture in place, to the geometry of its depth map. Called for every frame, before
    /// [`DepthSource::read`] if that is called at all. The default does nothing, since most depth maps match the
    /// picture as it is.
    fn rectify(&mut self, color: &mut ColorImage) {
        self.inner_mut().into_iter().for_each(|inner| inner.rectify(color));
    }

    /// Writes the depth of the frame `seen` into `map`, which is resized to fit.
    ///
    /// # Errors
    /// No depth is available for this frame, or it cannot be read; `map` is then unspecified.
    fn read(&mut self, seen: FrameInput, map: &mut DepthMap) -> Result<(), DepthError>;

    /// Returns the relative cost of a map at each effort level, ascending; the last and finest level is 1. A source
    /// without a choice has one level.
    fn efforts(&self) -> &'static [f64] {
        self.inner().map_or(&[1.0], |inner| inner.efforts())
    }

    /// Sets the effort level, an index into [`DepthSource::efforts`], from the next map on. The initial level is the
    /// finest.
    fn set_effort(&mut self, effort: usize) {
        self.inner_mut().into_iter().for_each(|inner| inner.set_effort(effort));
    }

    /// Whether later frames may reuse a map, warped by the picture's motion. False for maps whose outlines come from a
    /// mask: a mask is valid for its own frame only, and the person it shows is what moves most.
    fn is_reusable(&self) -> bool {
        self.inner().is_none_or(|inner| inner.is_reusable())
    }

    /// Whether the maps already contain the background behind the nearer surface, which makes a background memory
    /// unnecessary.
    fn knows_background(&self) -> bool {
        self.inner().is_some_and(|inner| inner.knows_background())
    }

    /// Sets whether the lens focuses on persons, from the next map on. If not, the source may skip person detection.
    fn set_focus_on_persons(&mut self, on: bool) {
        self.inner_mut().into_iter().for_each(|inner| inner.set_focus_on_persons(on));
    }

    /// Handles a seek in the source: from now on, the source's own time is ahead of media time by `ahead_ns`
    /// nanoseconds, and the scene may be a different one.
    fn seek(&mut self, ahead_ns: i64) {
        self.inner_mut().into_iter().for_each(|inner| inner.seek(ahead_ns));
    }

    /// Releases the device, if there is one, until the next [`DepthSource::read`]. Called when no frame came for a
    /// while.
    fn suspend(&mut self) {
        self.inner_mut().into_iter().for_each(|inner| inner.suspend());
    }

    /// Returns the source whose maps this one changes, if it does: methods without an implementation are then those of
    /// that source.
    fn inner(&self) -> Option<&dyn DepthSource> {
        None
    }

    /// Returns [`DepthSource::inner`] to be changed.
    fn inner_mut(&mut self) -> Option<&mut dyn DepthSource> {
        None
    }
}

/// The part of a frame that its depth may depend on.
#[derive(Clone, Copy, Debug)]
pub struct FrameInput<'a> {
    /// Index and times of the frame.
    pub stamp: Stamp,
    /// The picture; of a stereo pair, that of the left camera.
    pub color: &'a ColorImage,
    /// The picture of the right camera, for stereo sources.
    pub right: Option<&'a GrayImage>,
}

/// Why a frame has no depth.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum DepthError {
    /// A file that has the depth, or makes it, cannot be read.
    #[error(transparent)]
    File(Box<dyn Error + Send + Sync>),
    /// A depth camera has delivered no map yet. Later frames may have one.
    #[error("{source_name}: no depth yet")]
    Unpaired { source_name: String },
    /// Stereo matching failed.
    #[error(transparent)]
    Match(#[from] stereo::MatchError),
    /// A stereo frame lacks the picture of the right camera.
    #[error("{source_name}: this frame has no right picture")]
    MissingRight { source_name: String },
    /// A network failed.
    #[error("{name}: {why}")]
    Network { name: String, why: String },
    /// A background plate cannot be used.
    #[error("{name}: {why}")]
    Plate { name: String, why: String },
    /// The source has no depth at all.
    #[error("the effect dof needs depth, and {source_name} has none; use --effect blur or tilt-shift")]
    NoDepth { source_name: String },
}
