//! A folder of numbered PNG files.

use std::fs;
use std::io::{BufWriter, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::staged::Staged;
use super::{Options, Sink, SinkError};
use crate::frame::ColorImage;

/// `DIR/000000.png` and on, numbered in the order in which frames come out. Each file appears whole.
pub struct PngFolder {
    folder: PathBuf,
    force: bool,
    next: u64,
}

impl PngFolder {
    /// Makes the folder where it is missing.
    ///
    /// # Errors
    /// It has something in it and `force` is not set, or cannot be made.
    pub fn create(folder: &Path, options: &Options) -> Result<Self, SinkError> {
        fs::create_dir_all(folder).map_err(SinkError::write(folder))?;
        let mut entries = fs::read_dir(folder).map_err(SinkError::write(folder))?;
        if !options.force && entries.next().is_some() {
            return Err(SinkError::NotEmpty { path: folder.to_owned() });
        }
        Ok(Self { folder: folder.to_owned(), force: options.force, next: 0 })
    }

    fn encode(frame: &ColorImage, staged: &Staged) -> Result<(), SinkError> {
        let file = fs::File::create(staged.part()).map_err(SinkError::write(staged.path()))?;
        let mut buffered = BufWriter::with_capacity(1 << 16, file);
        PngEncoder::new_with_quality(&mut buffered, CompressionType::Fast, FilterType::Sub)
            .write_image(&frame.rgb, frame.width, frame.height, ExtendedColorType::Rgb8)
            .map_err(|error| match error {
                image::ImageError::IoError(cause) => SinkError::Write { path: staged.path().to_owned(), cause },
                other => SinkError::Png { path: staged.path().to_owned(), message: other.to_string() },
            })?;
        buffered.flush().map_err(SinkError::write(staged.path()))
    }

    /// Removes the tail of an earlier, longer sequence, which would read as part of this one.
    fn remove_older(&self) -> Result<(), SinkError> {
        let unreadable = || SinkError::write(&self.folder);
        for entry in fs::read_dir(&self.folder).map_err(unreadable())? {
            let path = entry.map_err(unreadable())?.path();
            if number(&path).is_some_and(|number| number >= self.next) {
                fs::remove_file(&path).map_err(SinkError::write(&path))?;
            }
        }
        Ok(())
    }
}

/// The number of a file that this sink would name so.
fn number(path: &Path) -> Option<u64> {
    let name = path.file_name()?.to_str()?;
    let number = name.strip_suffix(".png")?.parse().ok()?;
    (name == file_name(number)).then_some(number)
}

fn file_name(number: u64) -> String {
    format!("{number:06}.png")
}

impl Sink for PngFolder {
    fn put(&mut self, frame: &ColorImage) -> Result<ControlFlow<()>, SinkError> {
        let staged = Staged::new(&self.folder.join(file_name(self.next)), self.force)?;
        Self::encode(frame, &staged)?;
        staged.commit()?;
        self.next += 1;
        Ok(ControlFlow::Continue(()))
    }

    fn finish(self: Box<Self>) -> Result<(), SinkError> {
        if self.force { self.remove_older() } else { Ok(()) }
    }

    fn describe(&self) -> String {
        format!("PNG files in {}", self.folder.display())
    }
}
