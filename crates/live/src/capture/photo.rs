//! A photo as a camera: a single, static frame.

use std::sync::Arc;

use super::{Camera, CaptureError, Captured, FrameBuffers, FrameData, SourceInfo};
use bokehcam::frame::{ColorImage, Stamp};

/// Delivers one picture repeatedly.
pub struct Photo {
    name: String,
    color: Arc<ColorImage>,
    /// Total number of frames; `None` never ends.
    frames: Option<u64>,
    delivered: u64,
}

/// 10 frames a second: changes show soon, and each frame has the time that a photo of many pixels needs.
const PERIOD_NS: u64 = 100_000_000;

impl Photo {
    /// Shows `color` once, or, if `repeated`, `frames` times or endlessly.
    pub fn new(color: impl Into<Arc<ColorImage>>, name: &str, repeated: bool, frames: Option<u64>) -> Self {
        let frames = if repeated { frames } else { Some(1) };
        Self { name: name.to_owned(), color: color.into(), frames, delivered: 0 }
    }

    fn is_at_end(&self) -> bool {
        self.frames.is_some_and(|frames| self.delivered >= frames)
    }
}

impl Camera for Photo {
    fn info(&self) -> SourceInfo {
        SourceInfo {
            name: self.name.clone(),
            size: self.color.size(),
            period_ns: PERIOD_NS,
            frames: self.frames,
            live: false,
            frame_data: FrameData::Color,
        }
    }

    fn next(&mut self, buffers: FrameBuffers) -> Result<Captured, CaptureError> {
        if self.is_at_end() {
            return Ok(Captured::End);
        }
        buffers.color.resize(self.color.width, self.color.height);
        buffers.color.rgb.copy_from_slice(&self.color.rgb);
        let stamp = Stamp { index: 0, time_ns: self.delivered.saturating_mul(PERIOD_NS), captured_ns: None };
        self.delivered += 1;
        Ok(Captured::Frame(stamp))
    }

    fn skip_until(&mut self, until_ns: u64) -> u64 {
        let from = self.delivered;
        let until = until_ns.div_ceil(PERIOD_NS);
        self.delivered = from.max(self.frames.map_or(until, |frames| until.min(frames)));
        self.delivered - from
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bokehcam::frame::{DepthMap, GrayImage};

    #[test]
    fn a_photo_is_one_frame_or_as_many_as_are_asked_for() {
        let mut color = ColorImage::new(3, 2);
        color.rgb.fill(7);
        let count = |repeated, frames, skip_ns| {
            let mut photo = Photo::new(color.clone(), "photo", repeated, frames);
            let (mut into, mut depth, mut right) = (ColorImage::default(), DepthMap::default(), GrayImage::default());
            let mut times_ns = Vec::new();
            let skipped = photo.skip_until(skip_ns);
            while times_ns.len() < 5 {
                let buffers = FrameBuffers { color: &mut into, depth: &mut depth, right: &mut right };
                let Captured::Frame(stamp) = photo.next(buffers).unwrap() else { break };
                assert!(into == color && stamp.index == 0);
                times_ns.push(stamp.time_ns / 1_000_000);
            }
            (skipped, times_ns)
        };
        assert_eq!(count(false, None, 0), (0, vec![0]));
        assert_eq!(count(true, Some(3), 0), (0, vec![0, 100, 200]));
        assert_eq!(count(true, None, 250_000_000), (3, vec![300, 400, 500, 600, 700]));
        assert_eq!(count(true, Some(2), 250_000_000), (2, vec![]));
    }
}
