//! The project's own scene as a camera with exact depth.

use bokehcam::frame::Stamp;
use bokehcam_live::capture::synthetic::{self, Format};
use bokehcam_live::capture::{Camera, CaptureError, Captured, FrameBuffers, FrameData, SourceInfo};

use crate::scene::{Scene, View};

/// Renders a moving portrait, frame by frame on request.
pub struct Synthetic {
    scene: Scene,
    view: View,
    format: Format,
    position: u64,
}

/// One ray per pixel, because a camera must keep pace.
const SAMPLES_PER_PIXEL: u32 = 1;
/// Maximum width and height.
const MAX_SIDE_PX: u32 = 8192;

impl Synthetic {
    /// Creates a camera of the given format.
    ///
    /// # Errors
    /// The size is 0 or beyond 8192 pixels, or the rate is invalid.
    pub fn new(format: Format) -> Result<Self, CaptureError> {
        let Format { size: (width, height), fps, .. } = format;
        let sides = 1..=MAX_SIDE_PX;
        if !sides.contains(&width) || !sides.contains(&height) || !(0.001..=1000.0).contains(&fps) {
            return Err(CaptureError::Format { width, height, fps });
        }
        Ok(Self { scene: Scene::portrait(), view: View::new(width, height), format, position: 0 })
    }

    fn time_ns(&self, position: u64) -> u64 {
        (position as f64 / self.format.fps * 1e9).round() as u64
    }

    fn at_end(&self) -> bool {
        self.format.frames.is_some_and(|frames| self.position >= frames)
    }
}

/// Registers this camera as the source `synthetic`.
pub fn register() {
    synthetic::register_factory(|format| Ok(Box::new(Synthetic::new(format)?)));
}

impl Camera for Synthetic {
    fn info(&self) -> SourceInfo {
        SourceInfo {
            name: "synthetic".into(),
            size: self.format.size,
            period_ns: self.time_ns(1),
            frames: self.format.frames,
            live: false,
            frame_data: FrameData::Depth,
        }
    }

    fn next(&mut self, shot: FrameBuffers) -> Result<Captured, CaptureError> {
        if self.at_end() {
            return Ok(Captured::End);
        }
        let (time_s, threads) = (self.position as f64 / self.format.fps, self.format.threads.max(1));
        self.scene.render_pinhole(&self.view, time_s, SAMPLES_PER_PIXEL, threads, shot.color, shot.depth);
        let stamp = Stamp { index: self.position as usize, time_ns: self.time_ns(self.position), captured_ns: None };
        self.position += 1;
        Ok(Captured::Frame(stamp))
    }

    fn skip_until(&mut self, until_ns: u64) -> u64 {
        let from = self.position;
        while !self.at_end() && self.time_ns(self.position) < until_ns {
            self.position += 1;
        }
        self.position - from
    }
}
