//! The options that commands share, in groups: what can be written on the command line, in the environment or in
//! the settings file, before it means anything.

mod groups;
mod look;

use std::path::PathBuf;

use clap::Args;
use clap::builder::{BoolishValueParser, RangedI64ValueParser, TypedValueParser};

pub use groups::{Every, Streaming};
pub use look::{LookSettings, named};

use super::defaults;
#[cfg(feature = "window")]
pub use super::preview::options::Window;
use super::values::{DepthChoice, LogFormat, Size, seconds};
use crate::compute::Backend;
use crate::depth::stereo::Settings;
use crate::look::Effect;
use crate::look::number::{above_zero, within};
use crate::pipeline::Pace;
#[cfg(feature = "camera")]
use crate::v4l2::{FourCc, live::Setting};

/// Options of every command.
#[derive(Args, Debug)]
#[command(next_help_heading = "Everywhere")]
pub struct Global {
    /// Tell more; twice for details
    #[arg(short, long, global = true, action = clap::ArgAction::Count, conflicts_with = "quiet")]
    pub verbose: u8,
    /// Tell only what went wrong
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// How log lines are written to stderr; RUST_LOG chooses which
    #[arg(long, global = true, value_parser = named::<LogFormat>(), value_name = "FORMAT", default_value = "text")]
    pub log_format: LogFormat,
    /// Settings file instead of $XDG_CONFIG_HOME/bokehcam/config.toml
    #[arg(long, global = true, value_name = "FILE", env = "BOKEHCAM_CONFIG", hide_env = true)]
    pub config: Option<PathBuf>,
}

/// Which frames of which source.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Source")]
pub struct Source {
    /// Start this many seconds after the first frame
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub start: Option<f64>,
    /// End this many seconds after the first frame
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub end: Option<f64>,
    /// Begin again at the end; only with --frames or Ctrl-C does it end
    #[arg(long = "loop", value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = false,
          default_missing_value = "true", value_parser = BoolishValueParser::new(), hide_default_value = true,
          hide_possible_values = true)]
    pub repeat: bool,
    /// Stop after this many frames
    #[arg(long, value_name = "N", value_parser = RangedI64ValueParser::<u64>::new().range(1..))]
    pub frames: Option<u64>,
    /// Picture size; of a camera, the nearest that it has [default: 1280x720 of a camera, 640x480 of `synthetic`]
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,
    /// Frames per second; of a camera, the nearest that it has [default: 30]
    #[arg(long, value_name = "RATE", value_parser = rate)]
    pub fps: Option<f64>,
    /// Pixel format of a camera, such as MJPG, YUYV or NV12 [default: what its cable carries best]
    #[cfg(feature = "camera")]
    #[arg(long, value_name = "FOURCC")]
    pub format: Option<FourCc>,
    /// Set a camera's control; may be given more than once, or as a list with commas
    #[cfg(feature = "camera")]
    #[arg(long, value_name = "NAME=VALUE", value_delimiter = ',', value_parser = control)]
    pub control: Vec<Setting>,
}

/// How depth pictures are read.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Depth")]
pub struct Depth {
    /// Units of a 16-bit depth picture per metre (TUM 5000, millimetres 1000) [default: 5000; 1000 from a camera]
    #[arg(long, value_name = "UNITS", value_parser = above_zero)]
    pub depth_scale: Option<f32>,
    /// Value of a depth picture that means unknown
    #[arg(long, value_name = "VALUE", default_value = defaults::DEPTH_INVALID)]
    pub depth_invalid: u16,
    /// How a depth camera stands beside the colour camera: TOML with the tables [depth] and [color] (width, height, fx,
    /// fy, cx, cy, in pixels) and [depth-to-color] (rotation: 9 numbers row by row; translation_m: 3 numbers)
    /// [default: both see the same]
    #[arg(long, value_name = "FILE.toml")]
    pub depth_calibration: Option<PathBuf>,
}

impl Depth {
    /// Units per metre of depth pictures in files.
    pub fn file_scale(&self) -> f32 {
        self.depth_scale.unwrap_or(defaults::DEPTH_SCALE)
    }
}

/// Depth from two eyes.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Two eyes")]
pub struct Stereo {
    /// Each picture of the source shows both eyes beside each other: the left half is the left eye's
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = false,
          default_missing_value = "true", value_parser = BoolishValueParser::new(), hide_default_value = true,
          hide_possible_values = true)]
    pub side_by_side: bool,
    /// The pictures are a rectified pair already: the same point is in the same row
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = false,
          default_missing_value = "true", value_parser = BoolishValueParser::new(), hide_default_value = true,
          hide_possible_values = true)]
    pub rectified: bool,
    /// Calibration of the two eyes; may be given more than once, or as a list with commas, for one in two files
    #[arg(long, value_name = "FILE", value_delimiter = ',')]
    pub calib: Vec<PathBuf>,
    /// Disparities that are tried, in pixels: a multiple of 16 up to 256 [default: the recording's, else a tenth of the
    /// width]
    #[arg(long, value_name = "PX", value_parser = disparities)]
    pub max_disparity: Option<u32>,
    /// Focal length of a rectified pair, in pixels, with --baseline-m
    #[arg(long, value_name = "PX", value_parser = above_zero, conflicts_with = "calib")]
    pub focal_px: Option<f32>,
    /// Distance of its eyes, in metres
    #[arg(long, value_name = "M", value_parser = above_zero, conflicts_with = "calib")]
    pub baseline_m: Option<f32>,
    /// Column of its right principal point less that of the left, in pixels [default: 0]
    #[arg(long, value_name = "PX", value_parser = within(-10_000.0..=10_000.0),
          conflicts_with = "calib")]
    pub doffs_px: Option<f32>,
}

/// What the blur does.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Blur")]
pub struct Blur {
    /// A look by name: portrait, cinematic, dreamy, product, miniature, or one of your own ([presets.NAME] in the
    /// settings file); other settings of the look go before it
    #[arg(long, value_name = "NAME")]
    pub preset: Option<String>,
    /// Where depth comes from: auto (the source's, when the effect needs it: recorded, else from its two eyes), recorded
    /// (the source's), stereo (from its two eyes), none, a folder with a recording whose depth is played in a loop, or a
    /// depth camera (/dev/videoN, N, or part of its name)
    #[arg(long, value_name = "FROM", default_value = "auto")]
    pub depth: DepthChoice,
    /// The look, but for its quality.
    #[command(flatten)]
    pub look: LookSettings<false>,
}

impl Blur {
    /// Whether there was to be depth if the source has any, and else none.
    pub fn takes_whatever_depth(&self) -> bool {
        self.look.0.effect == Some(Effect::Auto) && self.depth == DepthChoice::Auto
    }
}

/// How finely and on what the blur is computed.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Computing")]
pub struct Computing {
    /// The quality of the look.
    #[command(flatten)]
    pub quality: LookSettings<true>,
    /// What runs the blur
    #[arg(long, value_parser = named::<Backend>(), value_name = "WHICH", default_value = "auto")]
    pub backend: Backend,
    /// Part of the name of the GPU to take
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
    /// Threads of the CPU backend [default: one per core]
    #[arg(long, value_name = "N", value_parser = threads())]
    pub threads: Option<usize>,
}

/// How a stream runs.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Stream")]
pub struct Stream {
    /// Time that the blur of one frame may take, in milliseconds [default: the frame period]
    #[arg(long, value_name = "MS", value_parser = above_zero)]
    pub budget_ms: Option<f32>,
    /// Whether frames come when they are due, or as fast as they can be written [default: realtime from a camera or
    /// into a virtual one, else asap]
    #[arg(long, value_parser = named::<Pace>(), value_name = "HOW")]
    pub pace: Option<Pace>,
    /// Picture size of a virtual camera; pictures of another size are fitted into it [default: the source's]
    #[arg(long, value_name = "WxH")]
    pub out_size: Option<Size>,
    /// Close the source's camera while nobody watches the virtual one
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = false,
          default_missing_value = "true", value_parser = BoolishValueParser::new(), hide_default_value = true,
          hide_possible_values = true)]
    pub on_demand: bool,
    /// Mirror the picture, as a mirror does
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = false,
          default_missing_value = "true", value_parser = BoolishValueParser::new(), hide_default_value = true,
          hide_possible_values = true)]
    pub mirror: bool,
    /// Count frames that fail and go on, instead of ending
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = false,
          default_missing_value = "true", value_parser = BoolishValueParser::new(), hide_default_value = true,
          hide_possible_values = true)]
    pub keep_going: bool,
    /// Write what happened to every frame, and how long it took, to this JSON file; - is standard output
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
}

/// What may be overwritten.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Output")]
pub struct Output {
    /// Overwrite what exists, once what replaces it is whole; of a folder, only files that bokehcam wrote
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = false,
          default_missing_value = "true", value_parser = BoolishValueParser::new(), hide_default_value = true,
          hide_possible_values = true)]
    pub force: bool,
}

#[cfg(feature = "camera")]
fn control(text: &str) -> Result<Setting, String> {
    let parts = text.split_once('=').map(|(name, value)| (name.trim(), value.trim()));
    let (name, value) = parts
        .filter(|(name, _)| !name.is_empty())
        .ok_or_else(|| "use NAME=VALUE, such as exposure_dynamic_framerate=0".to_string())?;
    Ok((name.to_owned(), value.to_owned()))
}

fn disparities(text: &str) -> Result<u32, String> {
    const MOST: u32 = Settings::MOST_DISPARITIES;
    let good = |disparities: &u32| (16..=MOST).contains(disparities) && disparities.is_multiple_of(16);
    text.parse().ok().filter(good).ok_or_else(|| format!("use a multiple of 16 from 16 to {MOST}"))
}

/// A parser of numbers of threads.
pub fn threads() -> impl TypedValueParser<Value = usize> {
    RangedI64ValueParser::<u64>::new().range(1..=1024).map(|threads| threads as usize)
}

fn rate(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|rate| (0.1..=1000.0).contains(rate))
        .ok_or_else(|| "use frames per second from 0.1 to 1000".to_string())
}
