use std::error::Error;
use std::io;
use std::path::{Path, PathBuf};

use bokehcam_files::folder::FolderError;

/// Why a frame could not be written.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum SinkError {
    /// The name is not that of a sink.
    #[error(
        "no sink '{name}'{}: use /dev/videoN or pipewire[:NAME] (a virtual camera), window, DIR/ (a folder, with the slash), FILE.y4m, \
         FILE.mp4, FILE.mkv, FILE.webm, FILE.mov, - (y4m on standard output) or null",
        near.as_ref().map_or(String::new(), |near| format!(" (did you mean {near}?)"))
    )]
    Target { name: String, near: Option<String> },
    /// An existing folder, named without the slash that would make it a sink.
    #[error("no sink '{name}': it is a folder; to write numbered PNG files into it, give {name}/ (with the slash)")]
    NoSlash { name: String },
    /// Standard output is named `-`.
    #[error("for y4m on standard output, use -")]
    NameOfStdout,
    /// An existing file that is not a video.
    #[error("{} is neither a folder nor a video: give DIR/, FILE.y4m, FILE.mp4, FILE.mkv, FILE.webm or FILE.mov", path.display())]
    NoFolder { path: PathBuf },
    #[error("{} is {what}, and is not replaced by a file; choose another name{}", path.display(), if *what == "a pipe" { ", or write y4m into it by `--to - > PIPE`" } else { "" })]
    NoFile {
        path: PathBuf,
        /// For example a folder.
        what: &'static str,
    },
    #[error("{} exists; choose another name or overwrite it with --force", path.display())]
    Exists { path: PathBuf },
    /// The folder cannot be written.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// Writing failed, but the frames until then are kept.
    #[error("{error}; the frames written before it are kept as {}", kept.display())]
    Kept { error: Box<SinkError>, kept: PathBuf },
    /// Writing failed, and the frames until then could not be kept.
    #[error("{error}; the frames written before it are lost as well: {cause}")]
    Lost { error: Box<SinkError>, cause: io::Error },
    /// The file or its folder was removed while it was written.
    #[error("{} was removed while it was being written", path.display())]
    Removed { path: PathBuf },
    /// A defect of this program.
    #[error("{sink}: panicked: {what}; please report this")]
    Panic { sink: String, what: String },
    /// The system refused a thread for an output.
    #[error("{sink}: cannot start its thread: {cause}")]
    Thread { sink: String, cause: io::Error },
    /// The file system refused.
    #[error("cannot write {}: {cause}", path.display())]
    Write { path: PathBuf, cause: io::Error },
    /// The disk is full.
    #[error("the disk is full (No space left on device): {} ends early", path.display())]
    Full { path: PathBuf },
    /// A frame's size differs from the stream's.
    #[error("the stream is {} x {} pixels, and a frame has {} x {}", made_for.0, made_for.1, got.0, got.1)]
    Size { made_for: (u32, u32), got: (u32, u32) },
    /// A defect of this program.
    #[error("this output received YUYV without requesting it; please report this")]
    Yuyv,
    /// A defect of this program.
    #[error("this output received an alpha channel, which it cannot keep; please report this")]
    Alpha,
    /// The PNG encoder refused.
    #[error("cannot write {} as PNG: {message}", path.display())]
    Png { path: PathBuf, message: String },
    /// The ffmpeg program is missing.
    #[error(
        "writing {} needs the program ffmpeg, which was not found: install the package ffmpeg, or write FILE.y4m",
        path.display()
    )]
    NoFfmpeg { path: PathBuf },
    /// The ffmpeg program failed.
    #[error("ffmpeg could not write {} ({status}): {}", path.display(), if stderr.is_empty() { "it gave no \
        reason" } else { stderr })]
    Ffmpeg {
        path: PathBuf,
        status: String,
        /// Its last lines, joined by ` | `.
        stderr: String,
    },
    /// A window where none can be opened.
    #[error(
        "a window needs a command that shows pictures, such as `bokehcam preview SOURCE`, in a program built with the feature \
         window; for a folder of this name, give window/"
    )]
    Window,
    /// The virtual camera cannot be written to, or PipeWire does not accept it.
    #[error(transparent)]
    Camera(Box<dyn Error + Send + Sync>),
    /// The program was built without PipeWire.
    #[error(
        "--to pipewire: this program was built without PipeWire; build it with the feature pipewire. For a folder of this \
         name, ./pipewire"
    )]
    NoPipeWire,
    /// The name of a PipeWire camera is empty or unreadable.
    #[error("pipewire:NAME needs a readable name, such as pipewire:'My camera'; without a name, use pipewire")]
    NoLabel,
    /// A filter without a PipeWire camera as the source.
    #[error("--to filter is for a stream of a camera that PipeWire has: bokehcam stream pipewire:NAME --to filter")]
    Filter,
    /// The program was built without virtual cameras.
    #[error("{}: this program was built without cameras; build it with the feature camera", path.display())]
    NoCamera { path: PathBuf },
}

impl SinkError {
    /// Converts a system error, for `map_err`: adds the path.
    pub(super) fn write(path: &Path) -> impl FnOnce(io::Error) -> Self {
        |cause| match cause.kind() {
            io::ErrorKind::StorageFull => Self::Full { path: path.to_owned() },
            _ => Self::Write { path: path.to_owned(), cause },
        }
    }
}
