//! Options for opening a source, for files and cameras.

// The help texts contain brackets that are not links.
#![allow(rustdoc::broken_intra_doc_links)]

mod orientation;
mod single_camera;

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;

use super::{SourceError, video::is_video};
use crate::layout::FourCc;
use bokehcam::depth::stereo::Settings;
use bokehcam::look::number::{in_range_parser, parse_count, parse_positive, parse_switch, whole_number_parser};
use bokehcam::look::{LookFacts, Metres};
use bokehcam::names;
use bokehcam_media::recording::depth_file::{self, Fit};
use bokehcam_media::recording::map_sequence::is_map_folder;
use bokehcam_media::recording::{DepthUnit, is_recording_file};
pub use orientation::Orientation;
pub use single_camera::{NetworkFile, Networks, Order, PlateFile, Range, SingleCameraDepth};

/// Units of a 16-bit depth picture per metre: the TUM convention.
pub const DEPTH_SCALE: f32 = 5000.0;
/// Units of a depth camera per metre: most use millimetres.
const LIVE_DEPTH_SCALE: f32 = 1000.0;

/// Which frames of which source.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Source")]
pub struct Frames {
    /// Start this many seconds after the first frame
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    pub start: Option<f64>,
    /// End this many seconds after the first frame
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    pub end: Option<f64>,
    /// Start again at the end of the source; the run ends only by --frames or Ctrl-C
    #[arg(long = "loop", value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = false,
          default_missing_value = "true", value_parser = parse_switch, hide_default_value = true)]
    pub repeat: bool,
    /// Stop after this many frames; of a camera, after as many were delivered
    #[arg(long, value_name = "N", value_parser = parse_count::<u64>)]
    pub frames: Option<u64>,
    /// Picture size; for a camera, its nearest size; for single scenes of several sizes (KITTI), which of them [default:
    /// 1280x720 for a camera, 640x480 for `synthetic`; `demo` has its own]
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,
    /// Frames per second; for a camera, its nearest rate; for a recording, only if it has no times [default: 30]
    #[arg(long, value_name = "RATE", value_parser = parse_rate)]
    pub fps: Option<f64>,
    /// Topic of a ROS recording (.mcap) with colour or depth; may be given more than once, or as a list with commas
    /// [default: the only one of either, else colour rather than infrared, and depth aligned to it]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub topic: Vec<String>,
    /// Read recordings whose links lead outside their folder
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = false,
          default_missing_value = "true", value_parser = parse_switch, hide_default_value = true)]
    pub follow_links: bool,
    /// How the pictures are turned, flipped and cut.
    #[command(flatten)]
    pub orientation: Orientation,
    /// Pixel format of a camera, such as MJPG, YUYV or NV12 [default: the best for its connection]
    #[arg(long, value_name = "FOURCC")]
    pub format: Option<FourCc>,
    /// Set a control of the camera; may be given more than once, or as a list with commas
    #[arg(long, value_name = "NAME=VALUE", value_delimiter = ',', value_parser = parse_control)]
    pub control: Vec<(String, String)>,
}

/// How depth pictures are read.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Depth")]
pub struct Depth {
    /// Units of a 16-bit depth picture per metre (TUM 5000, millimetres 1000) [default: the recording's, else 5000; 1000
    /// from a camera]
    #[arg(long, value_name = "UNITS", value_parser = parse_positive)]
    pub depth_scale: Option<f32>,
    /// Value of a depth picture that means unknown, besides 0
    #[arg(long, value_name = "VALUE", default_value = "0", value_parser = whole_number_parser(0..=u16::MAX))]
    pub depth_invalid: u16,
    /// Meaning of the values in depth pictures: metres (scaled by --depth-scale), millimetres, scale:N (N units per
    /// metre), inverse (relative inverse depth, as from networks and phones: the largest values, white, are near) or
    /// disparity (of a photo's map) [default: what a photo's map states or unmistakably is; metres in recordings]
    #[arg(long, value_name = "UNIT")]
    pub depth_unit: Option<DepthUnit>,
    /// In inverse depth, the largest values (white) are far
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = false,
          default_missing_value = "true", value_parser = parse_switch, hide_default_value = true)]
    pub depth_invert: bool,
    /// Fit of a depth map with another aspect ratio: stretch (both show the same view) or crop (the picture is the middle
    /// of the map) [default: stretch up to 2 %, and squares for a photo]
    #[arg(long, value_name = "HOW", value_parser = names::parse_name::<Fit>)]
    pub depth_fit: Option<Fit>,
    /// Position of the depth camera relative to the colour camera: TOML with the tables [depth] and [color] (width,
    /// height, fx, fy, cx, cy, in pixels; distortion, optional) and [depth-to-color] (rotation: 9 numbers row by row;
    /// translation_m: 3 numbers) [default: what the recording states, else both have the same view]
    #[arg(long, value_name = "FILE.toml")]
    pub depth_calibration: Option<PathBuf>,
}

impl Depth {
    /// Describes the options of depth maps that have no effect, as depth is `what`; `None` if there are none.
    pub fn describe_unused(&self, what: &str) -> Option<String> {
        let given = [
            (self.depth_invalid != 0, "--depth-invalid"),
            (self.depth_unit.is_some(), "--depth-unit"),
            (self.depth_invert, "--depth-invert"),
            (self.depth_fit.is_some(), "--depth-fit"),
        ];
        let names: Vec<_> = given.into_iter().filter_map(|(is_given, name)| is_given.then_some(name)).collect();
        (!names.is_empty()).then(|| format!("without effect here: {} (depth is {what})", names.join(", ")))
    }

    /// Returns how to read the depth map of a photo.
    pub fn of_photo(&self) -> depth_file::Options {
        depth_file::Options {
            unit: self.depth_unit,
            invert: self.depth_invert,
            scale: self.depth_scale,
            invalid: Some(f32::from(self.depth_invalid)),
            fit: self.depth_fit,
            range: None,
        }
    }

    /// Returns the units per metre of a depth camera.
    pub fn live_scale(&self) -> f32 {
        self.depth_scale.unwrap_or(LIVE_DEPTH_SCALE)
    }
}

/// Stereo depth from two cameras.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Stereo")]
pub struct Stereo {
    /// Each picture of the source shows the left and right camera side by side, the left camera in the left half
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = false,
          default_missing_value = "true", value_parser = parse_switch, hide_default_value = true)]
    pub side_by_side: bool,
    /// The pictures are already rectified: a point is in the same row of both
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = false,
          default_missing_value = "true", value_parser = parse_switch, hide_default_value = true)]
    pub rectified: bool,
    /// Calibration of the two cameras, of OpenCV, ROS, Kalibr, EuRoC, ZED or OAK-D to rectify the pictures,
    /// or the calib.txt of a rectified pair of Middlebury, ETH3D or KITTI; may be given more than once, or as a list
    /// with commas, for a calibration in two files
    #[arg(long, value_name = "FILE", value_delimiter = ',')]
    pub calib: Vec<PathBuf>,
    /// Range of disparities to search, in pixels: a multiple of 16 up to 256 [default: the recording's, else a tenth of
    /// the width]
    #[arg(long, value_name = "PX", value_parser = parse_disparities)]
    pub max_disparity: Option<u32>,
    /// Focal length of a rectified pair, in pixels, with --baseline-m
    #[arg(long, value_name = "PX", value_parser = parse_positive, conflicts_with = "calib")]
    pub focal_px: Option<f32>,
    /// Distance between the two cameras, in metres: with --focal-px, or instead of the one in --calib
    #[arg(long, value_name = "M", value_parser = parse_positive)]
    pub baseline_m: Option<f32>,
    /// Column of the right principal point minus that of the left, in pixels [default: 0]
    #[arg(long, value_name = "PX", value_parser = in_range_parser(-10_000.0..=10_000.0),
          conflicts_with = "calib")]
    pub doffs_px: Option<f32>,
}

/// The origin of depth.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum DepthChoice {
    /// The source's own, if the effect needs it.
    #[default]
    Auto,
    /// The source's own.
    Recorded,
    /// Stereo matching of the source's two cameras.
    Stereo,
    /// None, for effects that need none.
    None,
    /// The depth of the recording in this folder or file, or the depth maps in this folder, one for each frame.
    Folder(PathBuf),
    /// A video of relative depth, frame by frame.
    Video(PathBuf),
    /// A depth camera, by its path or name.
    Device(String),
    /// A clean plate or networks, from the pictures alone.
    SingleCamera(SingleCameraDepth),
    /// Depth from the slight defocus of a photograph itself.
    Defocus,
}

impl DepthChoice {
    /// Returns whether the depth is not the source's own.
    pub fn is_external(&self) -> bool {
        matches!(self, Self::Folder(_) | Self::Video(_) | Self::Device(_) | Self::SingleCamera(_) | Self::Defocus)
    }

    /// Returns what depth that is there or not allows a look.
    ///
    /// # Errors
    /// The source's own depth is wanted, and it has none.
    pub fn look_facts(&self, has_depth: bool, metres: Metres) -> Result<LookFacts, SourceError> {
        if *self == Self::Recorded && !has_depth {
            return SourceError::usage_error("--depth recorded: the source has no depth");
        }
        let is_declined = has_depth && *self == Self::None;
        Ok(LookFacts { has_depth: has_depth && !is_declined, is_declined, metres, ..LookFacts::default() })
    }

    /// Returns whether it is a file for each frame, or a frame of a video: frames are then counted.
    pub fn counts_frames(&self) -> bool {
        matches!(self, Self::Video(_)) || self.map_folder().is_some()
    }

    /// Returns the folder of depth maps that it names, unless that is a recording.
    pub fn map_folder(&self) -> Option<&Path> {
        match self {
            Self::Folder(folder) => Some(&**folder).filter(|folder| is_map_folder(folder)),
            _ => None,
        }
    }

    /// Returns a hint for a message if a text resembles a keyword.
    pub fn suggest_keyword(text: &str) -> String {
        const WORDS: [&str; 8] = ["auto", "recorded", "stereo", "none", "matte", "mono", "plate", "defocus"];
        let meant = bokehcam::names::find_similar(text, WORDS).filter(|word| *word != text);
        meant.map_or(String::new(), |word| format!("did you mean {word}? "))
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
            "defocus" => Self::Defocus,
            "" => {
                return Err(
                    "use auto, recorded, stereo, none, matte, mono, plate, a recording, a video of depth, or a depth camera"
                        .to_string(),
                );
            }
            text if let Some(chosen) = SingleCameraDepth::parse(text) => Self::SingleCamera(chosen?),
            folder if Path::new(folder).is_dir() || is_recording_file(Path::new(folder)) => Self::Folder(folder.into()),
            file if Path::new(file).is_file() && is_video(Path::new(file)) => Self::Video(file.into()),
            device => Self::Device(device.to_owned()),
        })
    }
}

/// A size in pixels, each side 1 to 16384.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Width.
    pub width: u32,
    /// Height.
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

/// Parses `NAME=VALUE`; whether the camera has such a control is checked when it is open.
fn parse_control(text: &str) -> Result<(String, String), String> {
    let parts = text.split_once('=').map(|(name, value)| (name.trim(), value.trim()));
    let (name, value) = parts
        .filter(|(name, _)| !name.is_empty())
        .ok_or_else(|| "use NAME=VALUE, such as exposure_dynamic_framerate=0".to_string())?;
    Ok((name.to_owned(), value.to_owned()))
}

fn parse_disparities(text: &str) -> Result<u32, String> {
    const MAX: u32 = Settings::MAX_DISPARITIES;
    let good = |disparities: &u32| (16..=MAX).contains(disparities) && disparities.is_multiple_of(16);
    text.parse().ok().filter(good).ok_or_else(|| format!("use a multiple of 16 from 16 to {MAX}"))
}

fn parse_rate(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|rate| (0.1..=1000.0).contains(rate))
        .ok_or_else(|| "use frames per second from 0.1 to 1000".to_string())
}

/// Parses a time in seconds, from 0.
pub fn parse_seconds(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|s: &f64| s.is_finite() && *s >= 0.0).ok_or_else(|| "use seconds from 0".to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_of_depth_maps_without_effect_are_named() {
        let depth = Depth { depth_invalid: 20, depth_invert: true, ..Depth::default() };
        let said = "without effect here: --depth-invalid, --depth-invert (depth is that of a mask)";
        assert_eq!(depth.describe_unused("that of a mask").as_deref(), Some(said));
        assert_eq!(Depth::default().describe_unused("that of a mask"), None);
    }

    #[test]
    fn wrong_sizes_say_what_is_accepted() {
        for text in ["640", "0x480", "640x", "99999x1"] {
            assert!(text.parse::<Size>().unwrap_err().contains("1280x720"), "{text}");
        }
    }
}
