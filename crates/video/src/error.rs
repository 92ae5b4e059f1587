//! Errors of video files: what is wrong, where, and what to do, in one line.

use std::io;
use std::path::{Path, PathBuf};

use super::MAX_SIDE_PX;
use bokehcam::depth::DepthError;
use bokehcam_files::input;

/// Why a video file delivers no picture.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum VideoError {
    /// ffmpeg or ffprobe is missing.
    #[error("reading {} needs the programs ffmpeg and ffprobe, which were not found: install the package ffmpeg", path.display())]
    NoFfmpeg { path: PathBuf },
    /// The file or the program cannot be read.
    #[error("{}: {}", path.display(), input::format_io_error(source))]
    Io { path: PathBuf, source: io::Error },
    /// The file has no bytes.
    #[error("{}: the file is empty; copy or export it again", path.display())]
    Empty { path: PathBuf },
    /// ffmpeg does not know the file.
    #[error("{}: ffmpeg cannot read it: {what}; copy or export it again", path.display())]
    Unreadable { path: PathBuf, what: String },
    /// The file leads to other files, or is of a rare format.
    #[error(
        "{}: it is no video but a list of others, or of a format that is not read ({format}); give the video itself, or \
         convert it: ffmpeg -i IN -c:v libx264 OUT.mp4",
        path.display()
    )]
    Unlisted { path: PathBuf, format: String },
    /// The file has sound only, or a cover picture.
    #[error("{}: there is no video in it, only sound or other data; give another file", path.display())]
    NoVideo { path: PathBuf },
    /// The pictures need a key.
    #[error("{}: it is encrypted; give a copy without protection", path.display())]
    Encrypted { path: PathBuf },
    /// The pictures are too large.
    #[error(
        "{}: its pictures are {width}x{height}, and at most {max}x{max} are read; --size WxH scales them down",
        path.display(), max = MAX_SIDE_PX
    )]
    TooLarge { path: PathBuf, width: u32, height: u32 },
    /// The file is truncated or damaged.
    #[error(
        "{}: damaged or cut short after {frames} frames: {what}; copy or export it again, or accept it \
         by `stream --keep-going`",
        path.display()
    )]
    Damaged { path: PathBuf, frames: u64, what: String },
    /// A video of depth does not cover the pictures.
    #[error(
        "{}: the depth is {}x{}, which does not cover pictures of {}x{}; export it with the same aspect",
        path.display(), found.0, found.1, color.0, color.1
    )]
    DepthSize { path: PathBuf, found: (u32, u32), color: (u32, u32) },
    /// A video of depth has colours.
    #[error(
        "{}: a video in colours is not depth, as colours have no order; export grey or numbers from the depth tool (such as \
         --grayscale, --save_npz, or a folder of .npy)", path.display()
    )]
    ColoredDepth { path: PathBuf },
    /// A video of depth belongs to other pictures.
    #[error(
        "{}: its depth has {frames} frames, and the pictures have {needed} or more; export the depth of every frame",
        path.display()
    )]
    FrameCount { path: PathBuf, frames: u64, needed: u64 },
    /// ffmpeg does nothing any more.
    #[error("{}: ffmpeg hung, and was killed", path.display())]
    Hung { path: PathBuf },
}

impl VideoError {
    /// Converts a system error, for `map_err`: adds the path.
    pub(super) fn io(path: &Path) -> impl FnOnce(io::Error) -> Self {
        |source| Self::Io { path: path.to_owned(), source }
    }

    /// Converts an error in starting ffmpeg or ffprobe for the file at `path`, for `map_err`.
    pub(super) fn start(path: &Path) -> impl FnOnce(io::Error) -> Self {
        |source| match source.kind() {
            io::ErrorKind::NotFound => Self::NoFfmpeg { path: path.to_owned() },
            _ => Self::io(path)(source),
        }
    }
}

impl From<VideoError> for DepthError {
    fn from(error: VideoError) -> Self {
        Self::File(error.into())
    }
}
