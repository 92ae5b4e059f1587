//! Values of options that are more than a number: how they are written, read and checked.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::ValueEnum;

use crate::bokeh;
use crate::look::{self, number_in};

/// What drives the blur.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Effect {
    /// dof with depth, else blur
    Auto,
    /// The radius follows depth
    Dof,
    /// A sharp band, and blur that grows away from it
    TiltShift,
    /// One radius everywhere
    Blur,
    /// Frames pass through
    None,
}

/// How `dof` is composited.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Method {
    /// Depth bins, blurred and composited front to back
    Layered,
    /// Every pixel gathers with its own radius: the paper's plain form
    Gather,
}

impl From<Method> for bokeh::Method {
    fn from(method: Method) -> Self {
        match method {
            Method::Layered => Self::Layered,
            Method::Gather => Self::Gather,
        }
    }
}

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

/// Whether depth is refined before the blur.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Refine {
    /// Depth of a recording in a stream; not exact depth, nor a picture on its own
    Auto,
    /// Always
    On,
    /// Never: only holes are filled
    Off,
}

impl From<Refine> for look::Refine {
    fn from(refine: Refine) -> Self {
        match refine {
            Refine::Auto => Self::Auto,
            Refine::On => Self::On,
            Refine::Off => Self::Off,
        }
    }
}

/// What runs the blur.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Backend {
    /// A hardware GPU if there is one, else the CPU
    Auto,
    /// A GPU, or an error
    Gpu,
    /// The CPU
    Cpu,
}

/// How fast recorded frames are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Pace {
    /// As they were recorded; late frames are dropped
    Realtime,
    /// As fast as they are delivered; none is dropped
    Asap,
}

/// How log lines are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LogFormat {
    /// For people
    Text,
    /// One JSON object a line
    Json,
}

/// A value, or `auto`: what the picture or the quality level calls for. The file's may be set aside so, too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OrAuto<T> {
    /// `auto`.
    Auto,
    /// This one.
    This(T),
}

impl<T> OrAuto<T> {
    /// The value, where one is chosen.
    pub fn chosen(self) -> Option<T> {
        match self {
            Self::Auto => None,
            Self::This(value) => Some(value),
        }
    }

    /// A parser of what `parse` does, and of `auto`.
    pub fn parser(
        parse: impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static,
    ) -> impl Fn(&str) -> Result<Self, String> + Clone + Send + Sync + 'static {
        move |text| match text {
            "auto" => Ok(Self::Auto),
            value => parse(value).map(Self::This).map_err(|accepted| format!("{accepted}, or auto")),
        }
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

/// A parser of numbers from `low` to `high`, both accepted.
pub fn between(low: f32, high: f32) -> impl Fn(&str) -> Result<f32, String> + Clone + Send + Sync + 'static {
    move |text| number_in(text, low, high).ok_or_else(|| format!("use a number from {low} to {high}"))
}

/// A parser of finite numbers above 0.
pub fn above_zero(text: &str) -> Result<f32, String> {
    number_in(text, 0.0, f32::MAX).filter(|number| *number > 0.0).ok_or_else(|| "use a number above 0".to_string())
}

/// A parser of finite numbers from 0.
pub fn not_negative(text: &str) -> Result<f32, String> {
    number_in(text, 0.0, f32::MAX).ok_or_else(|| "use a number from 0".to_string())
}

/// A parser of times in seconds, from 0.
pub fn seconds(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|s: &f64| s.is_finite() && *s >= 0.0).ok_or_else(|| "use seconds from 0".to_string())
}

#[cfg(test)]
mod tests;
