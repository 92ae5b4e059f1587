//! The enumerated settings of a look: effect, refinement and background memory.

use crate::names::named;

named! {
    /// What the blur follows.
    pub enum Effect default Auto {
        /// dof with depth, else blur
        Auto = "auto",
        /// The radius follows depth
        Dof = "dof",
        /// A sharp band, and blur that grows away from it
        TiltShift = "tilt-shift",
        /// One radius everywhere
        Blur = "blur",
        /// Frames pass through
        None = "none",
    }
}

impl Effect {
    /// Returns whether it needs depth, if there is any.
    pub fn follows_depth(self) -> bool {
        matches!(self, Self::Auto | Self::Dof)
    }
}

named! {
    /// Whether depth is refined before the blur.
    pub enum Refine default Auto {
        /// Only the depth of a recording in a stream, and depth that does not fit its picture
        Auto = "auto",
        /// Always
        On = "on",
        /// Never: only holes are filled
        Off = "off",
    }
}

named! {
    /// Whether a stream remembers what lies behind things.
    pub enum BackgroundMemory default On {
        /// The background seen in earlier frames; never seen parts are filled in from around them
        On = "on",
        /// All of it is filled in from around it, in every frame
        Off = "off",
    }
}

named! {
    /// Whether a stream keeps what hardly changes: noise in the blurred background is averaged over time.
    pub enum Reuse default Auto {
        /// Keeps it in real time
        Auto = "auto",
        /// Keeps it in every stream and sequence
        On = "on",
        /// Makes every frame on its own
        Off = "off",
    }
}

impl Reuse {
    /// Whether a stream keeps what hardly changes, in real time or not.
    pub fn is_on(self, realtime: bool) -> bool {
        match self {
            Self::Auto => realtime,
            Self::On => true,
            Self::Off => false,
        }
    }
}
