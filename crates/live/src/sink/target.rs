//! Parses and opens sinks by their names.

use std::fmt;
use std::fs;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use super::{Ffmpeg, Null, Options, PngFolder, Sink, SinkError, Y4m, Y4mFile};
use bokehcam::names::find_similar;
use bokehcam_files::{folder, place};

/// Prefix of the name of a PipeWire camera.
const PIPEWIRE: &str = "pipewire";
const FILTER: &str = "filter";

/// A sink as named on the command line (`--to`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// `null`
    Null,
    /// `-`: y4m on standard output.
    Stdout,
    /// `FILE.y4m`
    Y4m(PathBuf),
    /// `FILE.mp4`, `FILE.mkv`, `FILE.webm` or `FILE.mov`, through ffmpeg.
    Video(PathBuf),
    /// `/dev/videoN`, or another name of a device: a virtual camera.
    Device(PathBuf),
    /// `pipewire` or `pipewire:NAME`: a PipeWire camera, with the name shown to users.
    PipeWire(Option<String>),
    /// `filter`: replaces the source camera for all clients that request it.
    Filter,
    /// `window`: a window on the screen.
    Window,
    /// `DIR/`, or an existing folder written by this program: numbered PNG files.
    Folder(PathBuf),
}

impl FromStr for Target {
    type Err = SinkError;

    fn from_str(name: &str) -> Result<Self, SinkError> {
        let path = PathBuf::from(name);
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        match (name, extension.as_deref()) {
            ("", _) => Err(SinkError::Target { name: name.into(), near: None }),
            ("null", _) => Ok(Self::Null),
            ("-", _) => Ok(Self::Stdout),
            ("window", _) => Ok(Self::Window),
            (FILTER, _) => Ok(Self::Filter),
            ("/dev/stdout" | "/dev/fd/1" | "/proc/self/fd/1", _) => Err(SinkError::NameOfStdout),
            (PIPEWIRE, _) => Ok(Self::PipeWire(None)),
            _ if let Some(label) = name.strip_prefix(PIPEWIRE).and_then(|rest| rest.strip_prefix(':')) => {
                let is_label = !label.trim().is_empty() && !label.contains(char::is_control);
                is_label.then(|| Self::PipeWire(Some(label.to_owned()))).ok_or(SinkError::NoLabel)
            }
            _ if is_device(&path) => Ok(Self::Device(path)),
            _ if name.ends_with('/') || folder::has_file_list(&path) => Ok(Self::Folder(path)),
            (_, Some("y4m")) => Ok(Self::Y4m(path)),
            (_, Some("mp4" | "mkv" | "webm" | "mov")) => Ok(Self::Video(path)),
            // An unknown name must not become a folder: a typo in the name of a camera would fill the disk.
            _ if path.is_dir() => Err(SinkError::NoSlash { name: name.into() }),
            _ if path.exists() => Err(SinkError::NoFolder { path }),
            _ => Err(SinkError::Target { name: name.into(), near: suggest_sink(name) }),
        }
    }
}

/// Returns the sink that `name` may have been meant for.
fn suggest_sink(name: &str) -> Option<String> {
    if name.contains('/') && !name.starts_with("/dev/") {
        return None;
    }
    let number = name.trim_start_matches("/dev/").trim_start_matches("video");
    if !number.is_empty() && number.bytes().all(|digit| digit.is_ascii_digit()) {
        return Some(format!("/dev/video{number}"));
    }
    let (word, label) = name.find(':').map_or((name, ""), |at| name.split_at(at));
    find_similar(word, [PIPEWIRE, FILTER, "window", "null"]).map(|sink| format!("{sink}{label}"))
}

/// Whether this is a character device, or the name of a video device that does not exist yet.
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
            Self::Filter => f.write_str(FILTER),
            Self::PipeWire(None) => f.write_str(PIPEWIRE),
            Self::PipeWire(Some(label)) => write!(f, "{PIPEWIRE}:{label}"),
            Self::Y4m(path) | Self::Video(path) | Self::Device(path) | Self::Folder(path) => path.display().fmt(f),
        }
    }
}

impl Target {
    /// Opens the sink.
    ///
    /// # Errors
    /// Something of that name exists and `force` is not set, the place cannot be written, or ffmpeg is missing. A
    /// window is not a sink: the caller that starts the run opens it.
    pub fn open(&self, options: &Options) -> Result<Box<dyn Sink>, SinkError> {
        Ok(match self {
            Self::Null => Box::new(Null),
            Self::Stdout => Box::new(Y4m::stdout(options)?),
            Self::Y4m(path) => Box::new(Y4mFile::create(path, options)?),
            Self::Video(path) => Box::new(Ffmpeg::create(path, options)?),
            #[cfg(feature = "camera")]
            Self::Device(path) => Box::new(super::loopback::Loopback::open(path, options)?),
            #[cfg(feature = "pipewire")]
            Self::PipeWire(label) => Box::new(super::pipewire::PipeWire::open(label.as_deref(), options)?),
            #[cfg(feature = "pipewire")]
            Self::Filter => Box::new(super::pipewire::PipeWire::open_filter(options)?),
            #[allow(unreachable_patterns, reason = "in a build with all features")]
            Self::Device(path) => return Err(SinkError::NoCamera { path: path.clone() }),
            #[allow(unreachable_patterns, reason = "in a build with all features")]
            Self::PipeWire(_) | Self::Filter => return Err(SinkError::NoPipeWire),
            Self::Window => return Err(SinkError::Window),
            Self::Folder(path) => Box::new(PngFolder::create(path, options)?),
        })
    }

    /// Whether frames are seen as they come, and not stored.
    pub fn is_live(&self) -> bool {
        self.is_camera() || *self == Self::Window
    }

    /// Whether this is a virtual camera, whose pictures leave for a call.
    pub fn is_camera(&self) -> bool {
        matches!(self, Self::Device(_) | Self::PipeWire(_) | Self::Filter)
    }

    /// Whether it keeps an alpha channel.
    pub fn keeps_alpha(&self) -> bool {
        match self {
            Self::Null | Self::Folder(_) => true,
            Self::Video(path) => Ffmpeg::keeps_alpha_in(path),
            _ => false,
        }
    }

    /// Whether both write to the same place.
    pub fn collides_with(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Null, Self::Null) => false,
            (Self::Stdout, Self::Stdout) | (Self::Window, Self::Window) | (Self::Filter, Self::Filter) => true,
            (Self::PipeWire(own), Self::PipeWire(others)) => own == others,
            _ => match (self.path(), other.path()) {
                (Some(own), Some(others)) => is_same_place(own, others),
                _ => false,
            },
        }
    }

    /// Whether this is the device node `path`, by whatever name.
    pub fn is_device(&self, path: &Path) -> bool {
        matches!(self, Self::Device(own) if is_same_place(own, path))
    }

    /// The file, folder or device that this writes to, if it is one.
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::Null | Self::Stdout | Self::Window | Self::Filter | Self::PipeWire(_) => None,
            Self::Y4m(path) | Self::Video(path) | Self::Device(path) | Self::Folder(path) => Some(path),
        }
    }
}

/// Whether two names lead to the same file or device, which need not exist yet.
fn is_same_place(one: &Path, other: &Path) -> bool {
    let device = |path: &Path| fs::metadata(path).ok().filter(|node| node.file_type().is_char_device());
    match (device(one), device(other)) {
        (Some(one), Some(other)) => one.rdev() == other.rdev(),
        _ => place::resolve_links(one) == place::resolve_links(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_leaves_for_a_call_is_a_camera_and_nothing_else_is() {
        for (names, is_camera) in [
            (&["pipewire", "pipewire:Desk", "filter", "/dev/video7"][..], true),
            (&["null", "-", "window", "film.mp4", "film.y4m", "pictures/"], false),
        ] {
            for name in names {
                assert_eq!(name.parse::<Target>().unwrap().is_camera(), is_camera, "{name}");
            }
        }
    }
}
