//! The readers of the files that a look names. The program registers them: the engine knows no file format.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use super::LookError;
use crate::bokeh::aperture::Picture;
use crate::depth::backdrop::BackgroundVideo;
use crate::frame::ColorImage;

/// What reads the files.
#[derive(Clone, Copy, Debug)]
pub struct FileReaders {
    /// Reads the picture of an aperture.
    pub aperture: fn(&Path) -> Result<Picture, LookError>,
    /// Reads a picture for a virtual background.
    pub picture: fn(&Path) -> Result<ColorImage, LookError>,
    /// Opens a video for a virtual background.
    pub video: fn(&Path) -> Result<Arc<dyn BackgroundVideo>, LookError>,
}

static READERS: OnceLock<FileReaders> = OnceLock::new();

/// Registers the readers. Only the first call has an effect.
pub fn register_readers(readers: FileReaders) {
    // Later callers register the same functions.
    let _ = READERS.set(readers);
}

/// Returns the readers, for `file`.
///
/// # Errors
/// None are registered.
pub(super) fn readers_for(file: &Path) -> Result<&'static FileReaders, LookError> {
    let missing = || format!("{}: no reader of pictures is registered", file.display());
    READERS.get().ok_or_else(|| LookError::Picture(missing().into()))
}
