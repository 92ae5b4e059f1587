//! Options of several groups at once.

use clap::Args;

#[cfg(feature = "window")]
use super::Window;
use super::{Blur, Computing, Depth, Output, Source, Stereo, Stream};

/// What is needed to blur a stream, wherever it goes.
#[derive(Args, Clone, Debug)]
pub struct Streaming {
    /// Which frames.
    #[command(flatten)]
    pub frames: Source,
    /// The blur.
    #[command(flatten)]
    pub blur: Blur,
    /// Depth pictures.
    #[command(flatten)]
    pub depth: Depth,
    /// Two eyes.
    #[command(flatten)]
    pub stereo: Stereo,
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

/// Every setting: the keys of the settings file and of the environment.
#[derive(Args, Debug)]
pub struct Every {
    /// Which frames.
    #[command(flatten)]
    pub source: Source,
    /// Depth pictures.
    #[command(flatten)]
    pub depth: Depth,
    /// Two eyes.
    #[command(flatten)]
    pub stereo: Stereo,
    /// The blur.
    #[command(flatten)]
    pub blur: Blur,
    /// The executor.
    #[command(flatten)]
    pub computing: Computing,
    /// The stream.
    #[command(flatten)]
    pub stream: Stream,
    /// The window.
    #[cfg(feature = "window")]
    #[command(flatten)]
    pub window: Window,
    /// Overwriting.
    #[command(flatten)]
    pub output: Output,
}
