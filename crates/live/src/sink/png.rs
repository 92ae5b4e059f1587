//! A folder of numbered PNG files.

use std::io::{BufWriter, Write};
use std::mem;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::{Ending, Options, Sink, SinkError, interleave_alpha};
use bokehcam::frame::ColorImage;
use bokehcam_files::atomic_file::PartFile;
use bokehcam_files::folder::Folder;

/// Writes `DIR/000000.png` and on, numbered in output order. Each file appears complete; files of an earlier run stay
/// until all new ones exist.
pub struct PngFolder {
    path: PathBuf,
    /// `None` once it has ended.
    folder: Option<Folder>,
    next_number: u64,
    /// A picture with its alpha channel.
    rgba: Vec<u8>,
}

impl PngFolder {
    /// Opens the folder, creating it if it is missing.
    ///
    /// # Errors
    /// The folder is not empty and `force` is not set, contains another program's file, or cannot be created.
    pub fn create(path: &Path, options: &Options) -> Result<Self, SinkError> {
        let folder = Folder::open(path, options.force)?;
        Ok(Self { path: path.to_owned(), folder: Some(folder), next_number: 0, rgba: Vec::new() })
    }

    /// Writes interleaved `bytes` of a picture of `size`.
    fn write_png(&mut self, bytes: &[u8], size: (u32, u32), form: ExtendedColorType) -> Result<(), SinkError> {
        let Some(folder) = &mut self.folder else { return Ok(()) };
        let part = folder.create_file(&format!("{:06}.png", self.next_number))?;
        encode_png(bytes, size, form, &part)?;
        folder.commit_file(part)?;
        self.next_number += 1;
        Ok(())
    }

    /// Continues after a picture was written, or keeps what was written before it failed.
    fn check_written(&mut self, written: Result<(), SinkError>) -> Result<ControlFlow<()>, SinkError> {
        let Err(error) = written else { return Ok(ControlFlow::Continue(())) };
        // The first error is the one to report.
        let kept = self.folder.take().and_then(|folder| folder.finish_incomplete().ok().flatten());
        Err(match kept {
            Some(kept) => SinkError::Kept { error: Box::new(error), kept },
            None => error,
        })
    }
}

fn encode_png(bytes: &[u8], size: (u32, u32), form: ExtendedColorType, part: &PartFile) -> Result<(), SinkError> {
    let mut buffered = BufWriter::with_capacity(1 << 16, part.file());
    PngEncoder::new_with_quality(&mut buffered, CompressionType::Fast, FilterType::Sub)
        .write_image(bytes, size.0, size.1, form)
        .map_err(|error| match error {
            image::ImageError::IoError(cause) => SinkError::Write { path: part.path().to_owned(), cause },
            other => SinkError::Png { path: part.path().to_owned(), message: other.to_string() },
        })?;
    buffered.flush().map_err(SinkError::write(part.path()))
}

impl Sink for PngFolder {
    fn write_frame(&mut self, frame: &ColorImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
        let written = self.write_png(&frame.rgb, frame.size(), ExtendedColorType::Rgb8);
        self.check_written(written)
    }

    fn keeps_alpha(&self) -> bool {
        true
    }

    fn write_with_alpha(&mut self, frame: &ColorImage, alpha: &[u8], _: u64) -> Result<ControlFlow<()>, SinkError> {
        let mut rgba = mem::take(&mut self.rgba);
        interleave_alpha(frame, alpha, &mut rgba);
        let written = self.write_png(&rgba, frame.size(), ExtendedColorType::Rgba8);
        self.rgba = rgba;
        self.check_written(written)
    }

    fn finish(mut self: Box<Self>, ending: Ending) -> Result<(), SinkError> {
        let Some(folder) = self.folder.take() else { return Ok(()) };
        let path = self.path.display();
        match ending {
            Ending::Complete => match folder.finish()? {
                0 => {}
                gone => tracing::warn!("{path}: {gone} files of an earlier run are replaced by {}", self.next_number),
            },
            Ending::Truncated => {
                if let Some(kept) = folder.finish_incomplete()? {
                    tracing::warn!(
                        "{path} is unchanged: the new files are incomplete, and are kept as {}",
                        kept.display()
                    );
                }
            }
        }
        Ok(())
    }

    fn describe(&self) -> String {
        format!("PNG files in {}", self.path.display())
    }
}
