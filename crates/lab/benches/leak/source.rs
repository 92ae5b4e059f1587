//! Pictures and videos of a card that another program has blurred.

use std::fs;
use std::path::{Path, PathBuf};

use crate::experiment::codec;
use bokehcam::frame::ColorImage;
use bokehcam_media::recording::still;
use bokehcam_video::VideoFile;

use super::Outcome;

/// Reads a picture, a folder of pictures, or a video, whose pictures have the card's `size`.
pub fn read(path: &Path, size: (u32, u32)) -> Outcome<Vec<ColorImage>> {
    let pictures = if path.is_dir() {
        let entries = fs::read_dir(path)?.collect::<Result<Vec<_>, _>>()?;
        let mut files: Vec<PathBuf> = entries.into_iter().map(|entry| entry.path()).collect();
        files.retain(|file| still::is_photo(file));
        files.sort();
        files.iter().map(|file| still::read_color(file)).collect::<Result<Vec<_>, _>>()?
    } else if still::is_photo(path) {
        vec![still::read_color(path)?]
    } else {
        codec::decode(path, VideoFile::open(path)?.size_px)?
    };
    let place = path.display();
    match pictures.iter().find(|picture| picture.size() != size) {
        _ if pictures.is_empty() => Err(format!("{place}: there are no pictures in it").into()),
        Some(other) => {
            let ((width, height), (card_width, card_height)) = (other.size(), size);
            Err(format!(
                "{place}: {width}x{height} pixels, and the card has {card_width}x{card_height}; show it unscaled, or \
                 give its --size"
            )
            .into())
        }
        None => Ok(pictures),
    }
}
