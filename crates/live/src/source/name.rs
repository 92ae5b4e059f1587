//! Parses the names of sources: cameras, folders of recordings, photos, `demo` and `synthetic`.

use std::ffi::OsStr;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use super::{DepthOrigin, Frames, Source, SourceError, cameras, containers, pipewire_cameras, suggestion, video};
use crate::capture::{demo, y4m};
use bokehcam_media::recording::{is_recording_file, pictures, still};

/// The name of the synthetic scene.
const SYNTHETIC: &str = "synthetic";

/// The prefix of PipeWire cameras.
const PIPEWIRE: &str = "pipewire:";

/// The kind of a source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kind {
    /// A camera, or two.
    #[default]
    Camera,
    /// A recording in a folder or a file of its own.
    Recording,
    /// The demonstration.
    Demo,
    /// A photo: a single frame.
    Photo,
    /// A video file.
    Video,
    /// A stream of y4m on standard input.
    Stdin,
    /// The synthetic scene.
    Synthetic,
}

impl Kind {
    /// Returns its name in one word, for metadata.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Camera => "camera",
            Kind::Recording => "recording",
            Kind::Demo => demo::NAME,
            Kind::Photo => "photo",
            Kind::Video => "video",
            Kind::Stdin => "stdin",
            Kind::Synthetic => SYNTHETIC,
        }
    }
}

/// A camera: the name from the user, and the device node that it resolved to.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedCamera {
    /// The name as written by the user.
    pub name: String,
    pub(super) node: PathBuf,
}

/// The name of a source.
#[derive(Clone, Debug, PartialEq)]
pub enum SourceName {
    /// The moving scene with exact depth, rendered frame by frame.
    Synthetic,
    /// The demonstration: a loop of that scene with its depth, embedded in the program.
    Demo,
    /// A recording: a folder, a file of its own such as `TAKE.mcap`, or a pattern such as `DIR/IMG_%04d.jpg`.
    Folder(PathBuf),
    /// A photo, of any kind of picture that is read.
    Photo(PathBuf),
    /// A video file.
    Video(PathBuf),
    /// A stream of y4m on standard input.
    Stdin,
    /// A camera.
    Camera(NamedCamera),
    /// A PipeWire camera, by the name after `pipewire:`.
    PipeWire(String),
    /// Two cameras, the left one first.
    Cameras([NamedCamera; 2]),
}

impl FromStr for SourceName {
    type Err = SourceError;
    fn from_str(text: &str) -> Result<Self, SourceError> {
        Self::parse_os(text.as_ref())
    }
}

/// Splits the names of two files, as of a left and a right video.
fn split_files(text: &str) -> Option<(&str, &str)> {
    text.split_once(',').filter(|(left, right)| [left, right].iter().all(|name| Path::new(name).is_file()))
}

/// Returns whether a text is meant as a path rather than the name of a camera.
fn is_path(text: &str) -> bool {
    text.contains('/') && !text.starts_with("/dev/")
}

/// Writes the name so that it parses again.
impl fmt::Display for SourceName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SourceName::Synthetic => f.write_str(SYNTHETIC),
            SourceName::Demo => f.write_str(demo::NAME),
            SourceName::Stdin => f.write_str(y4m::NAME),
            SourceName::Folder(path) | SourceName::Photo(path) | SourceName::Video(path) => path.display().fmt(f),
            SourceName::Camera(camera) => f.write_str(&camera.name),
            SourceName::PipeWire(name) => write!(f, "{PIPEWIRE}{name}"),
            SourceName::Cameras([left, right]) => write!(f, "{},{}", left.name, right.name),
        }
    }
}

/// Returns the accepted sources, for messages.
pub(super) fn accepted_sources() -> String {
    let cameras = match (cfg!(feature = "camera"), cfg!(feature = "pipewire")) {
        (false, _) => "",
        (true, false) => "a camera, two cameras LEFT,RIGHT, ",
        (true, true) => "a camera, pipewire:NAME, two cameras LEFT,RIGHT, ",
    };
    format!(
        "{cameras}a photo, a video, - (y4m on standard input), a folder with a recording or pictures, a .mcap, .r3d or \
         Kinect's .mkv file, demo or synthetic"
    )
}

/// Returns whether a text is meant as the name of a file: it has an extension, such as `clip.mp4`.
pub(super) fn is_file_name(text: &str) -> bool {
    const MAX_LETTERS: usize = 5;
    let is_extension = |text: &str| text.len() <= MAX_LETTERS && text.bytes().any(|byte| byte.is_ascii_alphabetic());
    !text.starts_with("/dev/") && Path::new(text).extension().is_some_and(|end| end.to_str().is_some_and(is_extension))
}

/// Creates the error for a missing file or folder; suggests a sibling with a similar name.
pub(super) fn missing_path_error(text: &str) -> SourceError {
    let path = Path::new(text);
    let is_file = is_file_name(text);
    let near = suggestion::find_similar(path, if is_file { Path::is_file } else { Path::is_dir });
    let hint = near.map_or(String::new(), |near| format!(", did you mean {}?", near.display()));
    SourceError::NotFound(match is_file {
        true => format!("there is no such file{hint}"),
        false => format!("there is no such folder{hint}; use {}", accepted_sources()),
    })
}

impl NamedCamera {
    pub fn node(&self) -> &Path {
        &self.node
    }
}

impl SourceName {
    /// Parses the name of a source. A folder's path need not be UTF-8.
    ///
    /// # Errors
    /// The name is not a source, or the source does not exist; the message says what is accepted.
    pub fn parse_os(name: &OsStr) -> Result<Self, SourceError> {
        let path = Path::new(name);
        match name.to_str() {
            Some(text) if text.starts_with(PIPEWIRE) => pipewire_cameras::parse(&text[PIPEWIRE.len()..]),
            Some(SYNTHETIC) => Ok(SourceName::Synthetic),
            Some(demo::NAME) => Ok(SourceName::Demo),
            Some(y4m::NAME) => Ok(SourceName::Stdin),
            _ if path.is_dir() || is_recording_file(path) => Ok(SourceName::Folder(path.to_owned())),
            _ if path.is_file() && still::is_photo(path) => Ok(SourceName::Photo(path.to_owned())),
            _ if path.is_file() && containers::is_container(path) => {
                SourceError::usage_error(containers::describe_conversion(path))
            }
            _ if let Some(video) = video::parse(path) => video,
            _ if path.is_file() => SourceError::usage_error(format!(
                "it is neither a folder, a photo nor a video: use {}",
                accepted_sources()
            )),
            _ if pictures::pattern_folder(path).is_some() => Ok(SourceName::Folder(path.to_owned())),
            Some(text) if let Some((left, right)) = split_files(text) => SourceError::usage_error(format!(
                "two files are no source; of videos of two cameras make one, side by side, and play it with --side-by-side: \
                 ffmpeg -i {left} -i {right} -filter_complex hstack BOTH.mkv"
            )),
            Some(text) if is_path(text) => Err(missing_path_error(text)),
            Some("") => SourceError::usage_error(format!("the name is empty: use {}", accepted_sources())),
            Some(text) => cameras::parse(text),
            None => Err(missing_path_error(&path.display().to_string())),
        }
    }

    /// Returns the name, or part of it, of a PipeWire camera.
    pub fn pipewire_name(&self) -> Option<&str> {
        match self {
            Self::PipeWire(name) => Some(name),
            _ => None,
        }
    }

    /// Returns the kind of the source.
    pub fn kind(&self) -> Kind {
        match self {
            SourceName::Synthetic => Kind::Synthetic,
            SourceName::Demo => Kind::Demo,
            SourceName::Folder(_) => Kind::Recording,
            SourceName::Photo(_) => Kind::Photo,
            SourceName::Video(_) => Kind::Video,
            SourceName::Stdin => Kind::Stdin,
            SourceName::PipeWire(_) | SourceName::Camera(_) | SourceName::Cameras(_) => Kind::Camera,
        }
    }

    /// Rejects the options for parts of a recording if this is not a recording.
    ///
    /// # Errors
    /// Such an option is given, and this is not a recording.
    pub fn check_frames(&self, frames: &Frames) -> Result<(), SourceError> {
        let what = match self {
            SourceName::Folder(_) | SourceName::Video(_) => return Ok(()),
            SourceName::Photo(_) if frames.start.is_none() && frames.end.is_none() => return Ok(()),
            SourceName::Photo(_) => {
                let what = "--start and --end are for recordings and videos: a photo is one frame; --loop --frames N repeats it";
                return Err(SourceError::Usage(what.to_owned()));
            }
            SourceName::Synthetic => SYNTHETIC,
            SourceName::Demo => demo::NAME,
            SourceName::Stdin if frames.start.is_some() || frames.end.is_some() || frames.repeat => {
                let what = "--start, --end and --loop are for recordings and videos: standard input is read only once";
                return Err(SourceError::Usage(what.to_owned()));
            }
            SourceName::Stdin => return Ok(()),
            SourceName::PipeWire(_) | SourceName::Camera(_) | SourceName::Cameras(_) => "a camera",
        };
        if frames.start.is_none() && frames.end.is_none() && !frames.repeat {
            return Ok(());
        }
        Err(SourceError::Usage(format!(
            "--start, --end and --loop are for recordings and videos: {what} never ends, give it --frames"
        )))
    }

    /// Returns the folders that a recording is read from, or the file of a photo or video.
    pub fn input_paths(&self) -> Vec<PathBuf> {
        match self {
            SourceName::Folder(path) => pictures::input_folders(path),
            SourceName::Photo(path) | SourceName::Video(path) => vec![path.clone()],
            _ => Vec::new(),
        }
    }

    /// Returns a note for users on a source that was opened with this name, in one line.
    pub fn describe_photo(&self, source: &Source) -> Option<String> {
        let SourceName::Photo(path) = self else { return None };
        let depth = match source.depth_from {
            DepthOrigin::Nothing => "without depth: a map NAME-depth.png beside it would be used",
            DepthOrigin::Networks | DepthOrigin::Plate => "with depth computed from it",
            _ => "with its own depth",
        };
        Some(format!(
            "{}: a photo, a single still frame, {depth}; only `render` keeps its colour profile, EXIF and XMP",
            path.display()
        ))
    }

    /// Returns the device nodes of its cameras.
    pub fn device_nodes(&self) -> Vec<&Path> {
        match self {
            SourceName::Camera(camera) => vec![&camera.node],
            SourceName::Cameras(cameras) => cameras.iter().map(|camera| camera.node.as_path()).collect(),
            _ => Vec::new(),
        }
    }
}
