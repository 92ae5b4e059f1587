//! What can be behind the subject.

#[cfg(feature = "files")]
use std::path::Path;
use std::path::PathBuf;
use std::sync::Arc;
#[cfg(feature = "files")]
use std::time::Duration;

use crate::frame::ColorImage;
#[cfg(feature = "files")]
use crate::video::{Conversion, Decoded, Decoder, Pixels, VideoError, VideoFile};

/// What to show behind the subject.
#[derive(Clone, Debug, Default)]
pub enum Background {
    /// The room, blurred.
    #[default]
    Blur,
    /// A colour, as sRGB codes.
    Color([u8; 3]),
    /// A picture, scaled to cover the frame and cropped equally on both sides.
    Picture(Arc<BackgroundPicture>),
    /// A video, scaled like a picture and played in a loop.
    #[cfg(feature = "files")]
    Video(Arc<BackgroundVideo>),
    /// Nothing: results have an alpha channel.
    Transparent,
}

/// A picture for a virtual background.
#[derive(Debug)]
pub struct BackgroundPicture {
    /// The file it was loaded from, if any.
    pub file: Option<PathBuf>,
    /// Its pixels.
    pub image: ColorImage,
}

impl PartialEq for Background {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Blur, Self::Blur) | (Self::Transparent, Self::Transparent) => true,
            (Self::Color(a), Self::Color(b)) => a == b,
            // Compares identity, not content: this comparison runs often.
            (Self::Picture(a), Self::Picture(b)) => Arc::ptr_eq(a, b),
            #[cfg(feature = "files")]
            (Self::Video(a), Self::Video(b)) => Arc::ptr_eq(a, b),
            _ => false,
        }
    }
}

/// A video for a virtual background.
#[cfg(feature = "files")]
#[derive(Debug)]
pub struct BackgroundVideo {
    /// The file.
    pub file: VideoFile,
    /// Its first picture, at most 4096 pixels a side.
    pub first: ColorImage,
}

/// Largest side of a video's first picture, in pixels.
#[cfg(feature = "files")]
const MAX_FIRST_PX: u32 = 4096;

/// How long one call of the decoder waits.
#[cfg(feature = "files")]
const PATIENCE: Duration = Duration::from_millis(100);

#[cfg(feature = "files")]
impl BackgroundVideo {
    /// Opens a video file, and decodes its first picture.
    ///
    /// # Errors
    /// The file is missing, not a video, or has no picture that can be decoded; ffmpeg is missing.
    pub fn open(path: &Path) -> Result<Self, VideoError> {
        let file = VideoFile::open(path)?;
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
}
