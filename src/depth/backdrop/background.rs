//! What can be behind the subject.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::frame::ColorImage;

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
    Video(Arc<dyn BackgroundVideo>),
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
            (Self::Video(a), Self::Video(b)) => Arc::ptr_eq(a, b),
            _ => false,
        }
    }
}

/// A video for a virtual background, decoded above the engine, which knows no file format.
pub trait BackgroundVideo: fmt::Debug + Send + Sync {
    /// Returns the file.
    fn file(&self) -> &Path;

    /// Returns the first picture.
    fn first(&self) -> &ColorImage;

    /// Decodes the pictures in a loop, scaled to cover frames of `size`. Hands each to `show`, which may take it, with
    /// its time in nanoseconds since the first, until `show` returns false. A single picture is handed over once.
    ///
    /// # Errors
    /// Why there are no more pictures.
    fn play(&self, size: (u32, u32), show: &mut dyn FnMut(u64, &mut ColorImage) -> bool) -> Result<(), String>;
}
