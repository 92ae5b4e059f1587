//! Where frames go.
//!
//! A file appears under its name only when it is whole: it is written beside that name and renamed. Nothing that
//! exists is overwritten unless that was asked for.

#[cfg(feature = "camera")]
mod card;
mod error;
mod ffmpeg;
#[cfg(feature = "camera")]
mod loopback;
mod png;
mod rate;
mod staged;
pub mod switch;
mod tee;
mod y4m;
pub mod yuv;

use std::fmt;
use std::fs;
use std::ops::ControlFlow;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

pub use error::SinkError;
pub use ffmpeg::Ffmpeg;
#[cfg(feature = "camera")]
pub use loopback::Loopback;
pub use png::PngFolder;
pub use switch::{Switch, Switchboard};
pub use tee::Tee;
pub use y4m::{Y4m, Y4mFile};

use crate::frame::ColorImage;
use crate::link::demand::Demand;

/// Takes finished frames, in order.
///
/// Dropping a sink without [`Sink::finish`] gives up its output: a file that is not whole never appears.
pub trait Sink: Send {
    /// Takes one frame. `Break` says that the reader at the other end has gone and wants no more, not even this one.
    ///
    /// # Errors
    /// The frame could not be written.
    fn put(&mut self, frame: &ColorImage) -> Result<ControlFlow<()>, SinkError>;

    /// How long a live output may go without a picture from now on; after that, [`Sink::repeat`] is called, again and
    /// again. `None` for everything that keeps what it was given.
    fn hold(&self) -> Option<Duration> {
        None
    }

    /// Shows the last picture again; a still card before the first, and while nobody watches. `Continue` says whether
    /// anything was shown; `Break` as for [`Sink::put`].
    ///
    /// # Errors
    /// It could not be written.
    fn repeat(&mut self) -> Result<ControlFlow<(), bool>, SinkError> {
        Ok(ControlFlow::Continue(false))
    }

    /// A frame goes by that is not in memory, and so cannot be given.
    fn pass_by(&mut self) {}

    /// Whether anything becomes of the frames it is given now; otherwise, where there is a viewer, only that counts.
    fn keeps(&self) -> bool {
        true
    }

    /// Completes the output after the last frame.
    ///
    /// # Errors
    /// The output could not be completed; it then does not appear.
    fn finish(self: Box<Self>) -> Result<(), SinkError>;

    /// One line for the report: what this is, and where.
    fn describe(&self) -> String;
}

/// Takes frames and forgets them.
pub struct Null;

impl Sink for Null {
    fn put(&mut self, _frame: &ColorImage) -> Result<ControlFlow<()>, SinkError> {
        Ok(ControlFlow::Continue(()))
    }

    fn finish(self: Box<Self>) -> Result<(), SinkError> {
        Ok(())
    }

    fn describe(&self) -> String {
        "null".into()
    }
}

/// A sink as named on the command line (`--to`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// `null`
    Null,
    /// `-`: y4m on standard output.
    Stdout,
    /// `FILE.y4m`
    Y4m(PathBuf),
    /// `FILE.mp4`, `FILE.mkv` or `FILE.webm`, through ffmpeg.
    Video(PathBuf),
    /// `/dev/videoN`, or another name of a device: a virtual camera.
    Device(PathBuf),
    /// `window`: seen on the screen.
    Window,
    /// `DIR/`, or any other name without an extension: numbered PNG files.
    Folder(PathBuf),
}

impl FromStr for Target {
    type Err = SinkError;

    fn from_str(name: &str) -> Result<Self, SinkError> {
        let path = PathBuf::from(name);
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        match (name, extension.as_deref()) {
            ("", _) => Err(SinkError::Target { name: name.into() }),
            ("null", _) => Ok(Self::Null),
            ("-", _) => Ok(Self::Stdout),
            ("window", _) => Ok(Self::Window),
            _ if is_device(&path) => Ok(Self::Device(path)),
            _ if name.ends_with('/') => Ok(Self::Folder(path)),
            (_, Some("y4m")) => Ok(Self::Y4m(path)),
            (_, Some("mp4" | "mkv" | "webm")) => Ok(Self::Video(path)),
            (_, None) => Ok(Self::Folder(path)),
            _ if path.is_dir() => Ok(Self::Folder(path)),
            _ => Err(SinkError::Target { name: name.into() }),
        }
    }
}

/// Whether a name is that of a device, or of one that is not there yet.
fn is_device(path: &Path) -> bool {
    let number = path.to_str().and_then(|name| name.strip_prefix("/dev/video"));
    number.is_some_and(|number| number.bytes().all(|digit| digit.is_ascii_digit()))
        || fs::metadata(path).is_ok_and(|node| node.file_type().is_char_device())
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Null => f.write_str("null"),
            Self::Stdout => f.write_str("-"),
            Self::Window => f.write_str("window"),
            Self::Y4m(path) | Self::Video(path) | Self::Device(path) | Self::Folder(path) => path.display().fmt(f),
        }
    }
}

/// What the frames will be like, what may be overwritten, and who is told of readers.
#[derive(Clone, Debug)]
pub struct Options {
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Time from frame to frame, > 0.
    pub period_ns: u64,
    /// Overwrite what exists.
    pub force: bool,
    /// Width and height of a virtual camera; `None`: those of the frames, the width made even.
    pub out_size: Option<(u32, u32)>,
    /// Told by a virtual camera whether somebody watches.
    pub demand: Option<Demand>,
}

impl Options {
    /// Nothing that exists is overwritten, and nobody is told of readers.
    pub fn new(size: (u32, u32), period_ns: u64) -> Self {
        Self { size, period_ns, force: false, out_size: None, demand: None }
    }
}

impl Target {
    /// Opens the sink.
    ///
    /// # Errors
    /// Something of that name exists and `force` is not set, the place cannot be written, or ffmpeg is missing. A
    /// window is no sink: it is opened by who starts the run.
    pub fn open(&self, options: &Options) -> Result<Box<dyn Sink>, SinkError> {
        Ok(match self {
            Self::Null => Box::new(Null),
            Self::Stdout => Box::new(Y4m::stdout(options)?),
            Self::Y4m(path) => Box::new(Y4mFile::create(path, options)?),
            Self::Video(path) => Box::new(Ffmpeg::create(path, options)?),
            #[cfg(feature = "camera")]
            Self::Device(path) => Box::new(Loopback::open(path, options)?),
            #[cfg(not(feature = "camera"))]
            Self::Device(path) => return Err(SinkError::NoCamera { path: path.clone() }),
            Self::Window => return Err(SinkError::Window),
            Self::Folder(path) => Box::new(PngFolder::create(path, options)?),
        })
    }

    /// Whether frames are seen as they come, and none later.
    pub fn is_live(&self) -> bool {
        matches!(self, Self::Device(_) | Self::Window)
    }

    /// Whether this is a device: a virtual camera.
    pub fn is_camera(&self) -> bool {
        matches!(self, Self::Device(_))
    }

    /// Whether both write to the same place.
    pub fn collides_with(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Null, Self::Null) => false,
            (Self::Stdout, Self::Stdout) | (Self::Window, Self::Window) => true,
            _ => match (self.path(), other.path()) {
                (Some(own), Some(others)) => same_place(own, others),
                _ => false,
            },
        }
    }

    /// Whether this is the device node `path`, by whatever name.
    pub fn is_device(&self, path: &Path) -> bool {
        matches!(self, Self::Device(own) if same_place(own, path))
    }

    /// The file, folder or device that this writes to, if it is one.
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::Null | Self::Stdout | Self::Window => None,
            Self::Y4m(path) | Self::Video(path) | Self::Device(path) | Self::Folder(path) => Some(path),
        }
    }
}

/// Whether two names lead to one file or device, be it there or not yet.
fn same_place(one: &Path, other: &Path) -> bool {
    let whole =
        |path: &Path| path.canonicalize().or_else(|_| std::path::absolute(path)).unwrap_or_else(|_| path.into());
    let device = |path: &Path| fs::metadata(path).ok().filter(|node| node.file_type().is_char_device());
    match (device(one), device(other)) {
        (Some(one), Some(other)) => one.rdev() == other.rdev(),
        _ => whole(one) == whole(other),
    }
}

/// The frames of a stream keep the size that its header states.
fn check_size(made_for: (u32, u32), frame: &ColorImage) -> Result<(), SinkError> {
    if frame.size() == made_for { Ok(()) } else { Err(SinkError::Size { made_for, got: frame.size() }) }
}
