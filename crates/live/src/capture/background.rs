//! Plays a video file behind the subject.

use std::path::Path;
use std::time::Duration;

use super::replay::PlayRange;
use super::video::{Video, warn_of_remarks};
use super::{Camera, CaptureError, Captured, FrameBuffers};
use bokehcam::depth::backdrop::{BackgroundVideo, cover_size};
use bokehcam::frame::{ColorImage, DepthMap, GrayImage};
use bokehcam_video::{Conversion, Decoded, Decoder, Pixels, VideoError, VideoFile};

/// Largest side of a video's first picture, in pixels.
const MAX_FIRST_PX: u32 = 4096;

/// How long one call of the decoder waits.
const PATIENCE: Duration = Duration::from_millis(100);

/// A video file for a virtual background.
#[derive(Debug)]
pub struct BackgroundFile {
    file: VideoFile,
    /// Its first picture, at most 4096 pixels a side.
    first: ColorImage,
}

impl BackgroundFile {
    /// Opens a video file, and decodes its first picture.
    ///
    /// # Errors
    /// The file is missing, not a video, or has no picture that can be decoded; ffmpeg is missing.
    pub fn open(path: &Path) -> Result<Self, VideoError> {
        let file = VideoFile::open(path)?;
        warn_of_remarks(&file);
        let scale = (f64::from(MAX_FIRST_PX) / f64::from(file.size_px.0.max(file.size_px.1))).min(1.0);
        let [width, height] =
            [file.size_px.0, file.size_px.1].map(|side| ((f64::from(side) * scale).round() as u32).max(1));
        let conversion = Conversion { size_px: (width, height), pixels: Pixels::Rgb24, fps: None, start_s: 0.0 };
        let mut decoder = Decoder::start(&file, &conversion)?;
        let mut first = ColorImage::new(width, height);
        loop {
            match decoder.read(&mut first.rgb, PATIENCE)? {
                Decoded::Picture(_) => return Ok(Self { file, first }),
                Decoded::Waiting => {}
                Decoded::End => return Err(VideoError::NoVideo { path: path.to_owned() }),
            }
        }
    }

    /// Does the same as [`BackgroundVideo::play`].
    fn play_loop(
        &self,
        size: (u32, u32),
        show: &mut dyn FnMut(u64, &mut ColorImage) -> bool,
    ) -> Result<(), CaptureError> {
        let range = PlayRange { looped: true, ..PlayRange::default() };
        let mut camera = Video::open(self.file.clone(), cover_size(self.file.size_px, size), None, range, true)?;
        let (mut depth, mut right) = (DepthMap::default(), GrayImage::default());
        let (mut color, mut last_index) = (ColorImage::default(), None);
        loop {
            match camera.next(FrameBuffers { color: &mut color, depth: &mut depth, right: &mut right })? {
                // A single picture needs no second lap.
                Captured::Frame(stamp) if last_index.replace(stamp.index) == Some(stamp.index) => return Ok(()),
                Captured::Frame(stamp) => {
                    if !show(stamp.time_ns, &mut color) {
                        return Ok(());
                    }
                }
                Captured::Corrupt(error) => return Err(error),
                Captured::Waiting | Captured::Lost(..) => {}
                Captured::End => return Ok(()),
            }
        }
    }
}

impl BackgroundVideo for BackgroundFile {
    fn file(&self) -> &Path {
        &self.file.path
    }

    fn first(&self) -> &ColorImage {
        &self.first
    }

    fn play(&self, size: (u32, u32), show: &mut dyn FnMut(u64, &mut ColorImage) -> bool) -> Result<(), String> {
        self.play_loop(size, show).map_err(|error| match error {
            CaptureError::Video(VideoError::Damaged { frames, what, .. }) => {
                format!("damaged or cut short after {frames} frames: {what}")
            }
            other => other.to_string(),
        })
    }
}
