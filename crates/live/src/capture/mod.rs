//! Sources of frames.

pub mod background;
pub mod demo;
mod error;
pub mod photo;
#[cfg(feature = "pipewire")]
pub mod pipewire;
pub mod pixels;
pub mod replay;
mod seek;
pub mod side_by_side;
pub mod stereo_pair;
pub mod synthetic;
pub mod transformed;
#[cfg(feature = "camera")]
pub mod v4l2;
pub mod video;
pub mod y4m;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

pub use error::CaptureError;
pub use seek::{SeekRequest, Seeker};

use crate::stats::DropCause;
use bokehcam::frame::{ColorImage, DepthMap, GrayImage, Stamp};

/// A source of frames.
pub trait Camera: Send {
    /// Describes this camera; constant during a run.
    fn info(&self) -> SourceInfo;

    /// Reads the next frame into `buffers`, as far as the camera [delivers them](SourceInfo::frame_data). A
    /// live camera waits for the frame, but not much longer than [`MAX_WAIT`]; for other cameras, the caller paces the
    /// frames. On any result but [`Captured::Frame`] the content of the buffers is unspecified.
    ///
    /// # Errors
    /// The camera failed, and will deliver no more frames.
    fn next(&mut self, buffers: FrameBuffers) -> Result<Captured, CaptureError>;

    /// Returns the camera whose frames this one changes, if it does: the methods below are then those of that camera.
    fn inner(&mut self) -> Option<&mut dyn Camera> {
        None
    }

    /// Skips the frames before media time `until_ns` without reading them; returns how many were skipped. Live cameras
    /// (see [`SourceInfo::live`]) cannot skip and return 0.
    fn skip_until(&mut self, until_ns: u64) -> u64 {
        self.inner().map_or(0, |inner| inner.skip_until(until_ns))
    }

    /// Returns how long the last call of [`Camera::next`] waited for the frame, in nanoseconds.
    fn waited_ns(&mut self) -> u64 {
        self.inner().map_or(0, |inner| inner.waited_ns())
    }

    /// Returns the handle that requests frames by position, if the camera can seek.
    fn seeker(&mut self) -> Option<Arc<Seeker>> {
        self.inner()?.seeker()
    }

    /// Seeks to a frame, by its position in the [seeker](Camera::seeker): it is read next, and media time continues as
    /// if it followed the previous frame. Returns how far, in nanoseconds, the source's own time is then ahead of media
    /// time.
    fn seek(&mut self, position: usize) -> i64 {
        self.inner().map_or(0, |inner| inner.seek(position))
    }

    /// Releases the device, if there is one, until [`Camera::next`] is called again: no client watches.
    fn suspend(&mut self) {
        self.inner().into_iter().for_each(|inner| inner.suspend());
    }
}

impl dyn Camera {
    /// Reads frames until one is there, and adds the number of those `lost` in between. Returns `None` at the end, or
    /// when the user stops.
    ///
    /// # Errors
    /// The camera failed, or the frame cannot be decoded.
    pub fn wait_for_frame(
        &mut self,
        FrameBuffers { color, depth, right }: FrameBuffers,
        stop: &AtomicBool,
        lost: &mut u64,
    ) -> Result<Option<Stamp>, CaptureError> {
        while !stop.load(Ordering::Relaxed) {
            match self.next(FrameBuffers { color: &mut *color, depth: &mut *depth, right: &mut *right })? {
                Captured::Frame(stamp) => return Ok(Some(stamp)),
                Captured::Corrupt(error) => return Err(error),
                Captured::Lost(count, _) => *lost += count,
                Captured::Waiting => {}
                Captured::End => break,
            }
        }
        Ok(None)
    }
}

/// Buffers for a frame. Those that the camera does not deliver stay unchanged.
#[derive(Debug)]
pub struct FrameBuffers<'a> {
    /// The picture; with a stereo camera, the left one.
    pub color: &'a mut ColorImage,
    /// Its ground-truth depth.
    pub depth: &'a mut DepthMap,
    /// The right camera's picture, captured at the same time and of the same size.
    pub right: &'a mut GrayImage,
}

/// The data that a camera delivers with each frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameData {
    /// The picture only.
    Color,
    /// The picture and its ground-truth depth.
    Depth,
    /// The left and the right camera's pictures.
    RightCamera,
}

/// Longest wait of a live camera in [`Camera::next`] before it returns [`Captured::Waiting`].
pub const MAX_WAIT: Duration = Duration::from_millis(100);

/// Properties of a camera.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceInfo {
    /// Name for the report and for messages.
    pub name: String,
    /// Width and height of every frame, in pixels.
    pub size: (u32, u32),
    /// Time between frames, > 0.
    pub period_ns: u64,
    /// Number of frames until the end, if known: for a progress bar. A live source does not end by itself: its run ends
    /// once as many were delivered, lost ones not included.
    pub frames: Option<u64>,
    /// Whether frames arrive at their own pace. Otherwise they can be read and skipped at will, and a real-time run
    /// waits for their media time.
    pub live: bool,
    /// The data in each frame.
    pub frame_data: FrameData,
}

impl SourceInfo {
    /// Returns whether a run that has delivered this number of frames is complete, though its source, a live one, does not end.
    pub fn is_complete(&self, delivered: u64) -> bool {
        self.live && self.frames.is_some_and(|frames| delivered >= frames)
    }
}

/// Result of reading a frame.
#[derive(Debug)]
pub enum Captured {
    /// A frame.
    Frame(Stamp),
    /// Number of frames lost before they could be read. Not the end: the next call continues.
    Lost(u64, DropCause),
    /// No frame yet; the camera may be absent for a while. The caller checks whether to stop, and calls again.
    Waiting,
    /// A frame that cannot be decoded.
    Corrupt(CaptureError),
    /// There are no more frames.
    End,
}
