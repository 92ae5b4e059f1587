//! Where frames come from.

pub mod demo;
mod error;
pub mod photo;
#[cfg(all(feature = "camera", feature = "pipewire"))]
pub mod pipewire;
pub mod pixels;
pub mod replay;
mod seek;
pub mod side_by_side;
pub mod synthetic;
pub mod two_eyes;
#[cfg(feature = "camera")]
pub mod v4l2;

use std::sync::Arc;
use std::time::Duration;

pub use error::CaptureError;
pub use seek::{Seeker, Wish};

use crate::frame::{ColorImage, DepthMap, GrayImage, Stamp};
use crate::stats::Cause;

/// Produces frames, one after the other.
pub trait Camera: Send {
    /// What this camera is; stays the same during a run.
    fn info(&self) -> SourceInfo;

    /// Reads the next frame into the buffers of `shot`, as far as the camera [brings it](SourceInfo::brings).
    /// A live camera waits for the frame, but not much longer than [`PATIENCE`]; the others leave it to the caller
    /// when the frame is due. On anything but [`Captured::Frame`] the buffers are unspecified.
    ///
    /// # Errors
    /// The camera failed, and there will be no more frames.
    fn next(&mut self, shot: Shot) -> Result<Captured, CaptureError>;

    /// Passes over the frames before media time `until_ns` without reading them; returns how many those were.
    /// Cameras that cannot (see [`SourceInfo::live`]) pass over none.
    fn skip(&mut self, until_ns: u64) -> u64 {
        let _ = until_ns;
        0
    }

    /// How long the last call of [`Camera::next`] waited for the frame to come, in nanoseconds.
    fn waited_ns(&self) -> u64 {
        0
    }

    /// What says which frame is wanted next, where one can go back and forth.
    fn seeker(&self) -> Option<Arc<Seeker>> {
        None
    }

    /// Goes to the frame at a place that the [seeker](Camera::seeker) knows: it is read next, and media time goes on as if it
    /// came after the one before. Returns by how much, in nanoseconds, the source's own time is ahead of media time from then
    /// on.
    fn seek(&mut self, place: usize) -> i64 {
        let _ = place;
        0
    }

    /// Nobody watches: lets go of the device, if there is one, until [`Camera::next`] is called again.
    fn rest(&mut self) {}
}

/// Buffers for a frame. What the camera does not bring stays as it is.
#[derive(Debug)]
pub struct Shot<'a> {
    /// The picture; of two eyes the left one's.
    pub color: &'a mut ColorImage,
    /// Its exact depth.
    pub depth: &'a mut DepthMap,
    /// What the right eye saw at the same time, as large as the picture.
    pub right: &'a mut GrayImage,
}

/// What a camera brings of each frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Brings {
    /// The picture alone.
    Color,
    /// The picture and its exact depth.
    Depth,
    /// The picture of the left eye, and the right eye's.
    RightEye,
}

/// How long a live camera may wait in [`Camera::next`] before it says [`Captured::Waiting`].
pub const PATIENCE: Duration = Duration::from_millis(100);

/// What a camera is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceInfo {
    /// For the report and for messages.
    pub name: String,
    /// Width and height of every frame, in pixels.
    pub size: (u32, u32),
    /// Time from frame to frame, > 0.
    pub period_ns: u64,
    /// Frames until the end, where that is known: for a progress bar.
    pub frames: Option<u64>,
    /// Whether frames come at their own pace. Otherwise they can be read and passed over at will, and a run that
    /// wants real time waits for their media time.
    pub live: bool,
    /// What frames consist of.
    pub brings: Brings,
}

/// What came of reading a frame.
#[derive(Debug)]
pub enum Captured {
    /// A frame.
    Frame(Stamp),
    /// So many frames came and went before they could be read. Not the end: the next call reads on.
    Lost(u64, Cause),
    /// No frame yet; the camera may be gone for a while. The caller looks whether it should stop, and asks again.
    Waiting,
    /// There was a frame, and it cannot be decoded.
    Corrupt(CaptureError),
    /// There are no more.
    End,
}
