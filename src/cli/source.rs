//! From SOURCE to a camera and its depth.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use super::error::CliError;
use super::{defaults, options};
use crate::capture::Camera;
use crate::capture::replay::{Part, Replay};
use crate::capture::synthetic::{Format, Synthetic};
#[cfg(feature = "camera")]
use crate::capture::v4l2::V4l2Camera;
use crate::depth::DepthSource;
use crate::depth::recorded::Recorded;
use crate::recording::{Options, Recording};
#[cfg(feature = "camera")]
use crate::v4l2::{layout::Content, live::Wish};

/// Where frames come from, as it is written.
#[derive(Clone, Debug, PartialEq)]
pub enum SourceName {
    /// The moving scene with known depth.
    Synthetic,
    /// A folder with a recording.
    Folder(PathBuf),
    /// A camera's node, and how it was called.
    #[cfg(feature = "camera")]
    Camera {
        /// As it is written.
        name: String,
        /// What that means now.
        node: PathBuf,
    },
}

impl FromStr for SourceName {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match Path::new(text) {
            _ if text == "synthetic" => Ok(SourceName::Synthetic),
            folder if folder.is_dir() => Ok(SourceName::Folder(folder.to_owned())),
            file if file.is_file() => Err(format!("it is no folder: use {}", sources())),
            _ => camera(text),
        }
    }
}

/// What can be a source.
fn sources() -> &'static str {
    match cfg!(feature = "camera") {
        true => "a camera, a folder with a recording, or synthetic",
        false => "a folder with a recording, or synthetic",
    }
}

#[cfg(feature = "camera")]
fn camera(text: &str) -> Result<SourceName, String> {
    match crate::v4l2::node::resolve(text) {
        Ok(node) => Ok(SourceName::Camera { name: text.to_owned(), node }),
        Err(error) => Err(format!("{error}; use {}", sources())),
    }
}

#[cfg(not(feature = "camera"))]
fn camera(text: &str) -> Result<SourceName, String> {
    let what = if text.starts_with("/dev/") || text.parse::<u32>().is_ok() {
        "this build leaves cameras out (feature `camera`)"
    } else {
        "there is no such folder, and this build leaves cameras out (feature `camera`)"
    };
    Err(format!("{what}: use {}", sources()))
}

impl SourceName {
    /// Whether the options that choose a part of a recording apply.
    fn check(&self, source: &options::Source) -> Result<(), CliError> {
        let what = match self {
            SourceName::Folder(_) => return Ok(()),
            SourceName::Synthetic => "synthetic",
            #[cfg(feature = "camera")]
            SourceName::Camera { .. } => "a camera",
        };
        if source.start.is_none() && source.end.is_none() && !source.repeat {
            return Ok(());
        }
        Err(CliError::Usage(format!(
            "--start, --end and --loop are for recordings: {what} never ends, give it --frames"
        )))
    }

    /// The device that frames come from, if it is one.
    pub fn device(&self) -> Option<&Path> {
        match self {
            SourceName::Synthetic | SourceName::Folder(_) => None,
            #[cfg(feature = "camera")]
            SourceName::Camera { node, .. } => Some(node),
        }
    }
}

/// An opened source.
pub struct Source {
    /// Gives the frames.
    pub camera: Box<dyn Camera>,
    /// Gives their depth, where the camera does not.
    pub depth: Option<Box<dyn DepthSource>>,
}

impl Source {
    /// Opens a source. With `keep_going`, faulty lines of a recording's lists become frames that fail.
    ///
    /// # Errors
    /// It cannot be read, it has no frame between `--start` and `--end`, or an option does not apply to it.
    pub fn open(
        name: &SourceName,
        source: &options::Source,
        depth: &options::Depth,
        keep_going: bool,
    ) -> Result<Self, CliError> {
        name.check(source)?;
        match name {
            SourceName::Synthetic => {
                let size = source.size.unwrap_or(defaults::SIZE);
                let camera = Synthetic::new(Format {
                    size: (size.width, size.height),
                    fps: source.fps.unwrap_or(defaults::FPS),
                    frames: source.frames,
                    threads: std::thread::available_parallelism().map_or(1, usize::from),
                })?;
                Ok(Self { camera: Box::new(camera), depth: None })
            }
            SourceName::Folder(folder) => {
                let options = Options {
                    depth_scale: depth.file_scale(),
                    depth_invalid: Some(depth.depth_invalid),
                    keep_going,
                    ..Options::default()
                };
                let recording = Arc::new(Recording::open(folder, &options)?);
                let name = folder.display().to_string();
                let part = Part {
                    start_s: source.start.unwrap_or(0.0),
                    end_s: source.end,
                    looped: source.repeat,
                    frames: source.frames,
                };
                let camera = Replay::new(Arc::clone(&recording), &name, &part)?;
                let depth = match recording.has_depth() {
                    true => Some(Box::new(Recorded::new(recording, &name)?) as Box<dyn DepthSource>),
                    false => None,
                };
                Ok(Self { camera: Box::new(camera), depth })
            }
            #[cfg(feature = "camera")]
            SourceName::Camera { name, .. } => {
                let wish = Wish {
                    content: Content::Color,
                    size_px: source.size.map(|size| (size.width, size.height)),
                    fps: source.fps,
                    fourcc: source.format,
                };
                let camera = V4l2Camera::open(name, wish, source.control.clone(), source.frames)?;
                Ok(Self { camera: Box::new(camera), depth: None })
            }
        }
    }

    /// Whether its frames have depth.
    pub fn has_depth(&self) -> bool {
        self.depth.is_some() || self.camera.info().exact_depth
    }
}
