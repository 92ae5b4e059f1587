//! Values of options that are more than a number: how they are written, read and checked.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use clap::ValueEnum;

use super::error::CliError;
use crate::bokeh::aperture::{Aperture, Picture, Shape};
use crate::recording::still::read_grey;

/// What drives the blur.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Effect {
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

/// Where the focal plane is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Focus {
    /// Chosen from the depth map.
    Auto,
    /// At this distance in metres, > 0.
    Metres(f32),
    /// At the depth seen at this point, in fractions of width and height.
    Point(f32, f32),
}

impl FromStr for Focus {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let use_this = || "use METRES above 0, auto, or X,Y as fractions of width and height (0 to 1)".to_string();
        if text == "auto" {
            return Ok(Focus::Auto);
        }
        match text.split_once(',') {
            Some((x, y)) => Ok(Focus::Point(
                number_in(x, 0.0, 1.0).ok_or_else(use_this)?,
                number_in(y, 0.0, 1.0).ok_or_else(use_this)?,
            )),
            None => number_in(text, 0.0, f32::MAX).filter(|m| *m > 0.0).map(Focus::Metres).ok_or_else(use_this),
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

/// How many separable terms approximate the aperture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rank {
    /// The first terms, 1 to 16.
    Terms(u32),
    /// All.
    Full,
}

impl FromStr for Rank {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse() {
            _ if text == "full" => Ok(Rank::Full),
            Ok(terms @ 1..=16) => Ok(Rank::Terms(terms)),
            _ => Err("use 1 to 16, or full".to_string()),
        }
    }
}

/// An aperture as it is written: its picture, if any, not yet read.
#[derive(Clone, Debug, PartialEq)]
pub enum ApertureName {
    /// `disc`.
    Disc,
    /// `ring:INNER`.
    Ring {
        /// Radius of the hole, 0 to below 1.
        inner: f32,
    },
    /// `polygon:N[:ROTATION_DEG[:CURVATURE]]`.
    Polygon {
        /// Number of blades, 3 to 16.
        blades: u32,
        /// Turn clockwise in degrees.
        rotation_deg: f32,
        /// 0 straight blades to 1 a circle.
        curvature: f32,
    },
    /// `heart`.
    Heart,
    /// `star:N`.
    Star {
        /// Number of points, 3 to 16.
        points: u32,
    },
    /// `image:FILE`.
    Image(PathBuf),
}

impl FromStr for ApertureName {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        const FORMS: &str = "use disc, ring:INNER (0 to below 1), polygon:N[:ROTATION_DEG[:CURVATURE]] (N 3 to 16, \
                             CURVATURE 0 to 1), heart, star:N (3 to 16) or image:FILE";
        if let Some(file) = text.strip_prefix("image:").filter(|file| !file.is_empty()) {
            return Ok(ApertureName::Image(file.into()));
        }
        let parts: Vec<&str> = text.split(':').collect();
        let corners = |text: &str| text.parse().ok().filter(|n| (3..=16).contains(n));
        let name = match parts[..] {
            ["disc"] => Some(ApertureName::Disc),
            ["heart"] => Some(ApertureName::Heart),
            ["ring", inner] => {
                number_in(inner, 0.0, 1.0).filter(|r| *r < 1.0).map(|inner| ApertureName::Ring { inner })
            }
            ["star", points] => corners(points).map(|points| ApertureName::Star { points }),
            ["polygon", blades, ref rest @ ..] if rest.len() <= 2 => (|| {
                Some(ApertureName::Polygon {
                    blades: corners(blades)?,
                    rotation_deg: rest.first().map_or(Some(0.0), |text| number_in(text, -360.0, 360.0))?,
                    curvature: rest.get(1).map_or(Some(0.0), |text| number_in(text, 0.0, 1.0))?,
                })
            })(),
            _ => None,
        };
        name.ok_or_else(|| FORMS.to_string())
    }
}

impl fmt::Display for ApertureName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ApertureName::Disc => f.write_str("disc"),
            ApertureName::Ring { inner } => write!(f, "ring:{inner}"),
            ApertureName::Polygon { blades, rotation_deg, curvature } => {
                write!(f, "polygon:{blades}")?;
                if *rotation_deg != 0.0 || *curvature != 0.0 {
                    write!(f, ":{rotation_deg}")?;
                }
                if *curvature != 0.0 {
                    write!(f, ":{curvature}")?;
                }
                Ok(())
            }
            ApertureName::Heart => f.write_str("heart"),
            ApertureName::Star { points } => write!(f, "star:{points}"),
            ApertureName::Image(file) => write!(f, "image:{}", file.display()),
        }
    }
}

impl ApertureName {
    /// The aperture, with the radial `intensity` -1 to 1.
    ///
    /// # Errors
    /// The picture of `image:FILE` cannot be read.
    pub fn load(&self, intensity: f32) -> Result<Aperture, CliError> {
        let shape = match *self {
            ApertureName::Disc => Shape::Disc,
            ApertureName::Ring { inner } => Shape::Ring { inner },
            ApertureName::Polygon { blades, rotation_deg, curvature } => {
                Shape::Polygon { blades, rotation_deg, curvature }
            }
            ApertureName::Heart => Shape::Heart,
            ApertureName::Star { points } => Shape::Star { points },
            ApertureName::Image(ref file) => {
                let (width, height, grey) = read_grey(file)?;
                Shape::Picture(Arc::new(Picture { width, height, grey }))
            }
        };
        Ok(Aperture { shape, intensity })
    }
}

fn number_in(text: &str, low: f32, high: f32) -> Option<f32> {
    text.trim().parse().ok().filter(|number| (low..=high).contains(number))
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
