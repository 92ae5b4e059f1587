//! The view of depth, in colours.

mod colors;
mod depth;
#[cfg(test)]
mod tests;

pub use depth::DepthView;

use bokehcam::names::named;

named! {
    /// What of a frame is shown.
    pub enum ViewMode default Picture {
        /// The picture
        Picture = "picture",
        /// Its depth, in colours
        Depth = "depth",
    }
}
