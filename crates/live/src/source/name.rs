//! Parses the names of sources: cameras, folders of recordings, photos, `demo` and `synthetic`.

use std::ffi::OsStr;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use super::{DepthOrigin, Frames, Source, SourceError, containers, suggestion, video};
use crate::capture::{demo, y4m};
#[cfg(feature = "camera")]
use crate::v4l2::node::NodeError;
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
#[cfg(feature = "camera")]
#[derive(Clone, Debug, PartialEq)]
pub struct NamedCamera {
    /// The name as written by the user.
    pub name: String,
    node: PathBuf,
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
    #[cfg(feature = "camera")]
    Camera(NamedCamera),
    /// A PipeWire camera, by the name after `pipewire:`.
    #[cfg(all(feature = "camera", feature = "pipewire"))]
    PipeWire(String),
    /// Two cameras, the left one first.
    #[cfg(feature = "camera")]
    Cameras([NamedCamera; 2]),
}

impl FromStr for SourceName {
    type Err = SourceError;
    fn from_str(text: &str) -> Result<Self, SourceError> {
        Self::parse_os(text.as_ref())
    }
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
            #[cfg(feature = "camera")]
            SourceName::Camera(camera) => f.write_str(&camera.name),
            #[cfg(all(feature = "camera", feature = "pipewire"))]
            SourceName::PipeWire(name) => write!(f, "{PIPEWIRE}{name}"),
            #[cfg(feature = "camera")]
            SourceName::Cameras([left, right]) => write!(f, "{},{}", left.name, right.name),
        }
    }
}

/// Returns the accepted sources, for messages.
fn accepted_sources() -> &'static str {
    match cfg!(feature = "camera") {
        true if cfg!(feature = "pipewire") => {
            "a camera, pipewire:NAME, two cameras LEFT,RIGHT, a photo, a video, - (y4m on standard input), a folder with a recording or pictures, a .mcap, .r3d or Kinect's .mkv file, demo or synthetic"
        }
        true => {
            "a camera, two cameras LEFT,RIGHT, a photo, a video, - (y4m on standard input), a folder with a recording or pictures, a .mcap, .r3d or Kinect's .mkv file, demo or synthetic"
        }
        false => {
            "a photo, a video, - (y4m on standard input), a folder with a recording or pictures, a .mcap, .r3d or Kinect's .mkv file, demo or synthetic"
        }
    }
}

/// Returns whether a text is meant as the name of a file: it has an extension, such as `clip.mp4`.
fn is_file_name(text: &str) -> bool {
    const MAX_LETTERS: usize = 5;
    let is_extension = |text: &str| text.len() <= MAX_LETTERS && text.bytes().any(|byte| byte.is_ascii_alphabetic());
    !text.starts_with("/dev/") && Path::new(text).extension().is_some_and(|end| end.to_str().is_some_and(is_extension))
}

/// Creates the error for a missing file or folder; suggests a sibling with a similar name.
fn missing_path_error(text: &str) -> SourceError {
    let path = Path::new(text);
    let is_file = is_file_name(text);
    let near = suggestion::find_similar(path, if is_file { Path::is_file } else { Path::is_dir });
    let hint = near.map_or(String::new(), |near| format!(", did you mean {}?", near.display()));
    SourceError::NotFound(match is_file {
        true => format!("there is no such file{hint}"),
        false => format!("there is no such folder{hint}; use {}", accepted_sources()),
    })
}

/// Parses the name of one camera, or of two as `LEFT,RIGHT`; errors suggest similar names.
#[cfg(feature = "camera")]
fn parse_cameras(text: &str) -> Result<SourceName, SourceError> {
    let named = |name: &str| {
        let node = crate::v4l2::node::resolve_node(name)?;
        Ok(NamedCamera { name: name.to_owned(), node })
    };
    let refuse = |error: NodeError| {
        if is_file_name(text) && matches!(error, NodeError::NotFound { .. }) {
            return Err(missing_path_error(text));
        }
        Err(SourceError::NotFound(match suggestion::find_similar(Path::new(text), Path::is_dir) {
            Some(near) => format!("{error}; or did you mean the folder {}? Use {}", near.display(), accepted_sources()),
            None => format!("{error}; use {}", accepted_sources()),
        }))
    };
    // Try a single camera first, as its own name may contain commas.
    let not_one_camera = match named(text) {
        Ok(camera) => return Ok(SourceName::Camera(camera)),
        Err(error) => error,
    };
    // For the same reason, try every comma as the separator.
    let halves = |(at, _): (usize, &str)| (&text[..at], &text[at + 1..]);
    let pairs = || text.match_indices(',').map(halves);
    for (left, right) in pairs() {
        if let (Ok(left), Ok(right)) = (named(left), named(right)) {
            let same = |a: &Path, b: &Path| a.canonicalize().ok() == b.canonicalize().ok();
            if same(&left.node, &right.node) {
                let what = format!("left and right are the same camera, {}", left.node.display());
                // If the names differ, the other camera may just not be plugged in.
                let may_come = left.name != right.name;
                return Err(if may_come { SourceError::NotFound(what) } else { SourceError::Usage(what) });
            }
            return Ok(SourceName::Cameras([left, right]));
        }
    }
    match pairs().next() {
        None => refuse(not_one_camera),
        // Report the half that is no camera.
        Some((left, right)) => refuse(named(left).and_then(|_| named(right)).err().unwrap_or(not_one_camera)),
    }
}

/// Parses the name after `pipewire:`; its existence is checked when it is opened.
fn parse_pipewire(name: &str) -> Result<SourceName, SourceError> {
    #[cfg(all(feature = "camera", feature = "pipewire"))]
    return match name.is_empty() {
        true => SourceError::usage_error("pipewire:NAME needs the name of a camera; `bokehcam devices` lists them"),
        false => Ok(SourceName::PipeWire(name.to_owned())),
    };
    #[cfg(not(all(feature = "camera", feature = "pipewire")))]
    return SourceError::usage_error(format!(
        "this build leaves PipeWire's cameras out (features `camera` and `pipewire`): {name} cannot be read"
    ));
}

#[cfg(not(feature = "camera"))]
fn parse_cameras(text: &str) -> Result<SourceName, SourceError> {
    let what = "this build leaves cameras out (feature `camera`)";
    Err(match text.starts_with("/dev/") || text.parse::<u32>().is_ok() {
        true => SourceError::Usage(format!("{what}: use {}", accepted_sources())),
        false if is_file_name(text) => missing_path_error(text),
        false => SourceError::NotFound(format!("there is no such folder, and {what}: use {}", accepted_sources())),
    })
}

#[cfg(feature = "camera")]
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
            Some(text) if text.starts_with(PIPEWIRE) => parse_pipewire(&text[PIPEWIRE.len()..]),
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
            Some(text) if is_path(text) => Err(missing_path_error(text)),
            Some("") => SourceError::usage_error(format!("the name is empty: use {}", accepted_sources())),
            Some(text) => parse_cameras(text),
            None => Err(missing_path_error(&path.display().to_string())),
        }
    }

    /// Returns the name, or part of it, of a PipeWire camera.
    pub fn pipewire_name(&self) -> Option<&str> {
        match self {
            #[cfg(all(feature = "camera", feature = "pipewire"))]
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
            #[cfg(all(feature = "camera", feature = "pipewire"))]
            SourceName::PipeWire(_) => Kind::Camera,
            #[cfg(feature = "camera")]
            SourceName::Camera(_) | SourceName::Cameras(_) => Kind::Camera,
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
            #[cfg(all(feature = "camera", feature = "pipewire"))]
            SourceName::PipeWire(_) => "a camera",
            #[cfg(feature = "camera")]
            SourceName::Camera(_) | SourceName::Cameras(_) => "a camera",
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
            SourceName::Synthetic | SourceName::Demo | SourceName::Stdin => Vec::new(),
            SourceName::Folder(_) | SourceName::Photo(_) | SourceName::Video(_) => Vec::new(),
            #[cfg(all(feature = "camera", feature = "pipewire"))]
            SourceName::PipeWire(_) => Vec::new(),
            #[cfg(feature = "camera")]
            SourceName::Camera(camera) => vec![&camera.node],
            #[cfg(feature = "camera")]
            SourceName::Cameras(cameras) => cameras.iter().map(|camera| camera.node.as_path()).collect(),
        }
    }
}
