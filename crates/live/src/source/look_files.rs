//! Reads the files that a look names.

use std::path::Path;
use std::sync::Arc;

use crate::capture::background::BackgroundFile;
use bokehcam::bokeh::aperture::Picture;
use bokehcam::look::{FileReaders, LookError, register_readers};
use bokehcam_media::recording::RecordingError;
use bokehcam_media::recording::still::{read_aperture, read_color};

/// Registers the readers of pictures and videos. A program calls it before it sets a look.
pub fn register_look_files() {
    register_readers(FileReaders {
        aperture: |file: &Path| {
            let (width, height, grey) = read_aperture(file).map_err(unreadable)?;
            Ok(Picture { file: Some(file.to_owned()), width, height, grey })
        },
        picture: |file| read_color(file).map_err(unreadable),
        video: |file| {
            let video = BackgroundFile::open(file).map_err(|error| LookError::Video(error.into()))?;
            Ok(Arc::new(video))
        },
    });
}

fn unreadable(error: RecordingError) -> LookError {
    LookError::Picture(error.into())
}
