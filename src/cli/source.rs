//! From SOURCE to a camera and its depth.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use super::error::CliError;
use super::options;
use crate::capture::Camera;
use crate::capture::replay::{Part, Replay};
use crate::capture::synthetic::{Format, Synthetic};
use crate::depth::DepthSource;
use crate::depth::recorded::Recorded;
use crate::recording::{Options, Recording};

/// Where frames come from, as it is written.
#[derive(Clone, Debug, PartialEq)]
pub enum SourceName {
    /// The moving scene with known depth.
    Synthetic,
    /// A folder with a recording.
    Folder(PathBuf),
}

impl FromStr for SourceName {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match Path::new(text) {
            _ if text == "synthetic" => Ok(SourceName::Synthetic),
            folder if folder.is_dir() => Ok(SourceName::Folder(folder.to_owned())),
            other if other.exists() => Err("it is no folder: use a folder with a recording, or synthetic".to_string()),
            _ => Err("there is no such folder: use a folder with a recording, or synthetic".to_string()),
        }
    }
}

impl SourceName {
    /// The device that frames come from, if it is one.
    pub fn device(&self) -> Option<&Path> {
        match self {
            SourceName::Synthetic | SourceName::Folder(_) => None,
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
        match name {
            SourceName::Synthetic if source.start.is_some() || source.end.is_some() || source.repeat => {
                let what = "--start, --end and --loop are for recordings: synthetic never ends, give it --frames";
                Err(CliError::Usage(what.to_string()))
            }
            SourceName::Synthetic => {
                let camera = Synthetic::new(Format {
                    size: (source.size.width, source.size.height),
                    fps: source.fps,
                    frames: source.frames,
                    threads: std::thread::available_parallelism().map_or(1, usize::from),
                })?;
                Ok(Self { camera: Box::new(camera), depth: None })
            }
            SourceName::Folder(folder) => {
                let options = Options {
                    depth_scale: depth.depth_scale,
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
        }
    }

    /// Whether its frames have depth.
    pub fn has_depth(&self) -> bool {
        self.depth.is_some() || self.camera.info().exact_depth
    }
}
