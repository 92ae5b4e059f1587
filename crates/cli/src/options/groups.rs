//! Combinations of option groups.

use clap::Args;

use super::{Blur, Computing, Depth, Frames, Networks, Output, Stereo, Stream};
use bokehcam_live::source::Options;

/// What is needed to blur a stream, wherever it goes.
#[derive(Args, Clone, Debug)]
pub struct Streaming {
    /// Which frames.
    #[command(flatten)]
    pub frames: Frames,
    /// The blur.
    #[command(flatten)]
    pub blur: Blur,
    /// Depth pictures.
    #[command(flatten)]
    pub depth: Depth,
    /// Stereo depth.
    #[command(flatten)]
    pub stereo: Stereo,
    /// Networks.
    #[command(flatten)]
    pub networks: Networks,
    /// The executor.
    #[command(flatten)]
    pub computing: Computing,
    /// The stream.
    #[command(flatten)]
    pub stream: Stream,
    /// Overwriting.
    #[command(flatten)]
    pub output: Output,
}

impl Streaming {
    /// Returns the options for opening the source.
    pub fn source_options(&self) -> Options {
        Options {
            frames: self.frames.clone(),
            depth: self.depth.clone(),
            stereo: self.stereo.clone(),
            networks: self.networks.clone(),
            depth_choice: self.blur.depth.clone(),
            computing: self.computing.to_compute_options(),
            keep_going: self.stream.keep_going,
            filters: false,
        }
    }
}

/// Every setting: the keys of the settings file and of the environment.
#[derive(Args, Debug)]
pub struct Every {
    /// Which frames.
    #[command(flatten)]
    pub source: Frames,
    /// Depth pictures.
    #[command(flatten)]
    pub depth: Depth,
    /// Stereo depth.
    #[command(flatten)]
    pub stereo: Stereo,
    /// Networks.
    #[command(flatten)]
    pub networks: Networks,
    /// The blur.
    #[command(flatten)]
    pub blur: Blur,
    /// The executor.
    #[command(flatten)]
    pub computing: Computing,
    /// The stream.
    #[command(flatten)]
    pub stream: Stream,
    #[cfg(feature = "window")]
    #[command(flatten)]
    pub window: super::window::Window,
    /// Overwriting.
    #[command(flatten)]
    pub output: Output,
}
