//! Values of options that are more than a number: how they are written, read and checked.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use crate::names::named;

/// Where depth comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DepthChoice {
    /// The source's, when the effect needs it.
    Auto,
    /// The source's.
    Recorded,
    /// The source's two eyes.
    Stereo,
    /// None: for the effects that need none.
    None,
    /// The depth of the recording in this folder.
    Folder(PathBuf),
    /// A depth camera, by its path or name.
    Device(String),
}

impl DepthChoice {
    /// Whether it names depth that is not the source's own.
    pub fn is_elsewhere(&self) -> bool {
        matches!(self, Self::Folder(_) | Self::Device(_))
    }
}

impl FromStr for DepthChoice {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        Ok(match text {
            "auto" => Self::Auto,
            "recorded" => Self::Recorded,
            "stereo" => Self::Stereo,
            "none" => Self::None,
            "" => {
                return Err(
                    "use auto, recorded, stereo, none, a folder with a recording, or a depth camera".to_string()
                );
            }
            folder if Path::new(folder).is_dir() => Self::Folder(folder.into()),
            device => Self::Device(device.to_owned()),
        })
    }
}

named! {
    /// How log lines are written.
    pub enum LogFormat default Text {
        /// For people
        Text = "text",
        /// One JSON object a line
        Json = "json",
    }
}

/// Columns and rows, each 1 to 16384.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl FromStr for Size {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let side = |text: &str| text.parse().ok().filter(|side| (1..=16384).contains(side));
        text.split_once(['x', 'X'])
            .and_then(|(width, height)| Some(Size { width: side(width)?, height: side(height)? }))
            .ok_or_else(|| "use WIDTHxHEIGHT, each 1 to 16384, such as 1280x720".to_string())
    }
}

/// A parser of times in seconds, from 0.
pub fn seconds(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|s: &f64| s.is_finite() && *s >= 0.0).ok_or_else(|| "use seconds from 0".to_string())
}

#[cfg(test)]
mod tests;
