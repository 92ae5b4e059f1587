//! What others see of a run while it goes on.

use crate::bokeh::{PassTimes, Picture};
use crate::budget::Quality;
use crate::frame::{ColorImage, DepthMap, Stamp};
use crate::link::pool::Pooled;
use crate::optics::CocField;
use crate::stats::Frames;

/// How far a run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Frames captured, those that were lost included.
    pub captured: u64,
    /// Frames delivered.
    pub delivered: u64,
    /// Frames dropped, for any cause.
    pub dropped: u64,
    /// Frames to be captured in all, where that is known.
    pub total: Option<u64>,
}

/// A frame, for who looks at more than the picture.
pub struct View {
    /// The picture; in memory where the sink was given it.
    pub picture: Picture,
    /// The picture before the blur; `None` where nothing was blurred.
    pub color: Option<Pooled<ColorImage>>,
    /// The depth that it was blurred by, holes filled.
    pub depth: Option<Pooled<DepthMap>>,
    /// The radius of every pixel.
    pub coc: CocField,
    /// Which frame it is.
    pub stamp: Stamp,
    /// When it was captured, on the run's clock.
    pub captured_ns: u64,
    /// What it took.
    pub trace: Trace,
    /// The counts of the run up to this frame.
    pub frames: Frames,
}

/// What a frame took on its way, in nanoseconds.
#[derive(Clone, Copy, Debug, Default)]
pub struct Trace {
    /// Reading and decoding, waits excluded.
    pub decode_ns: u64,
    /// Depth and CoC; next to nothing where they were taken over from the frame before.
    pub depth_ns: u64,
    /// The blur; 0 where there was none.
    pub blur_ns: u64,
    /// Its passes.
    pub passes: PassTimes,
    /// The number of the last change before it; 0 where there was none.
    pub change: u64,
    /// Whether it was blurred by the executor of the look before, as its own was still being made.
    pub between: bool,
    /// The rung it was blurred at.
    pub quality: Option<Quality>,
}
