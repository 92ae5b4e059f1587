//! The public view of a run in progress.

use bokehcam::bokeh::Picture;
use bokehcam::budget::Quality;
use bokehcam::frame::crop::Crop;
use bokehcam::frame::{ColorImage, DepthMap, Stamp};
use bokehcam::link::pool::Pooled;
use bokehcam::optics::CocField;

/// The progress of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Captured frames, lost ones included.
    pub captured: u64,
    /// Delivered frames.
    pub delivered: u64,
    /// Dropped frames, for any cause.
    pub dropped: u64,
    /// The total number of frames to capture, if known.
    pub total: Option<u64>,
    /// The quality level of the last frame; `None` if it was not blurred.
    pub quality: Option<Quality>,
}

/// A frame with its inputs, for viewers that need more than the picture.
pub struct View {
    /// The blurred picture; in memory if the sink received it.
    pub picture: Picture,
    /// The input picture; `None` if nothing was blurred.
    pub color: Option<Pooled<ColorImage>>,
    /// Its depth, holes filled, before the background was replaced.
    pub depth: Option<Pooled<DepthMap>>,
    /// The CoC radius of every pixel.
    pub coc: CocField,
    /// Identifies the frame.
    pub stamp: Stamp,
    /// The capture time, on the run's clock.
    pub captured_ns: u64,
    /// The crop that goes out; `None` is the whole picture.
    pub crop: Option<Crop>,
    /// The number of the last change before it; 0 if there was none.
    pub change: u64,
    /// Whether the previous look's executor blurred it, because its own was still being created.
    pub is_transitional: bool,
    /// The number of the last seek ([`Seeker`](crate::capture::Seeker)) before it; 0 if there was none.
    pub seek: u64,
    /// Whether it is the target of that seek: it is shown however late it is.
    pub is_seek_target: bool,
    /// Its processing times.
    pub trace: Trace,
}

impl View {
    /// Creates a view of a blurred picture of which nothing else is known.
    pub fn new(picture: Picture, coc: CocField) -> Self {
        Self {
            picture,
            color: None,
            depth: None,
            coc,
            stamp: Stamp { index: 0, time_ns: 0, captured_ns: None },
            captured_ns: 0,
            crop: None,
            change: 0,
            is_transitional: false,
            seek: 0,
            is_seek_target: false,
            trace: Trace::default(),
        }
    }
}

/// The processing times of a frame, in nanoseconds.
#[derive(Clone, Copy, Debug, Default)]
pub struct Trace {
    /// Whether it reuses the depth of an earlier frame.
    pub is_depth_reused: bool,
    /// Depth and CoC.
    pub depth_ns: u64,
    /// The blur; 0 if there was none.
    pub blur_ns: u64,
    /// Its age at output.
    pub age_ns: u64,
    /// The quality level of the blur.
    pub quality: Option<Quality>,
}
