//! What others see of a run while it goes on.

use crate::bokeh::{PassTimes, Picture};
use crate::budget::Quality;
use crate::frame::crop::Crop;
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
    /// The rung that the last frame was blurred at; `None` where it was not.
    pub quality: Option<Quality>,
}

/// A frame, for who looks at more than the picture.
pub struct View {
    /// The picture; in memory where the sink was given it.
    pub picture: Picture,
    /// The picture as it was taken; `None` where nothing was blurred.
    pub color: Option<Pooled<ColorImage>>,
    /// Its depth, holes filled, as it was before something else stood behind the subject.
    pub depth: Option<Pooled<DepthMap>>,
    /// The radius of every pixel.
    pub coc: CocField,
    /// Which frame it is.
    pub stamp: Stamp,
    /// When it was captured, on the run's clock.
    pub captured_ns: u64,
    /// The part of it that goes out; `None` is all.
    pub part: Option<Crop>,
    /// The number of the last change before it; 0 where there was none.
    pub change: u64,
    /// Whether it was blurred by the executor of the look before, as its own was still being made.
    pub is_between: bool,
    /// The number of the last wish of a [`Seeker`](crate::capture::Seeker) before it; 0 where there was none.
    pub seek: u64,
    /// Whether it is the frame of that wish: it is shown however late it is.
    pub is_wished: bool,
    /// What it took.
    pub trace: Trace,
    /// The counts of the run up to this frame.
    pub frames: Frames,
}

impl View {
    /// A picture that was blurred so, of which nothing else is known.
    pub fn of(picture: Picture, coc: CocField) -> Self {
        Self {
            picture,
            color: None,
            depth: None,
            coc,
            stamp: Stamp { index: 0, time_ns: 0, captured_ns: None },
            captured_ns: 0,
            part: None,
            change: 0,
            is_between: false,
            seek: 0,
            is_wished: false,
            trace: Trace::default(),
            frames: Frames::default(),
        }
    }
}

/// What a frame took on its way, in nanoseconds.
#[derive(Clone, Copy, Debug, Default)]
pub struct Trace {
    /// Whether its depth was taken over from an earlier frame.
    pub depth_held: bool,
    /// Reading and decoding, waits excluded.
    pub decode_ns: u64,
    /// Depth and CoC.
    pub depth_ns: u64,
    /// The blur; 0 where there was none.
    pub blur_ns: u64,
    /// All waits between stages until it was ready: in links, and where the executor had others in hand.
    pub between_ns: u64,
    /// The wait for its turn, so that frames come as evenly as they were taken.
    pub playout_ns: u64,
    /// How old it was then: all of the above, but for a stored frame's decoding, which is over when it is captured.
    pub age_ns: u64,
    /// The blur's passes.
    pub passes: PassTimes,
    /// The rung it was blurred at.
    pub quality: Option<Quality>,
}
