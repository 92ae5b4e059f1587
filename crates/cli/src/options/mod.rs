//! Option groups shared by commands: their values from the command line, the environment or the settings file.

mod groups;
mod look;
#[cfg(feature = "window")]
pub mod window;

use std::path::PathBuf;

use clap::Args;
use clap::builder::{OsStringValueParser, TypedValueParser};

pub use bokehcam_live::source::options::{Depth, Frames, Networks, Orientation, Stereo};
pub use groups::{Every, Streaming};
pub use look::{LookSettings, named_value_parser};

use bokehcam::compute::Backend;
use bokehcam::computing;
use bokehcam::look::Effect;
use bokehcam::look::number::{parse_positive, parse_switch, whole_number_parser};
use bokehcam::names;
use bokehcam_live::pipeline::Pace;
use bokehcam_live::source::{DepthChoice, Size, SourceName};

/// Help of `--depth` for streams.
const DEPTH: &str = "\
Where depth comes from:
  auto          the source's own; for a single camera or photo, from an installed network
  recorded      the source's own
  stereo        matching of the source's two cameras
  none          no depth, for effects that need none
  matte[:FILE]  a network that finds the person: FILE.onnx, or the best that is installed
  mono[:FILE]   a network that estimates distances; matte,mono is both together
  plate[:FILE]  a picture of the background without you, taken at the start if there is no FILE
                (the camera must not move)
  FOLDER        a recording, whose depth is played in a loop
  FILE          a video of relative depth, for a video of as many frames (white is near)
  CAMERA        a depth camera: /dev/videoN, N, or part of its name";

names::named! {
    /// How log lines are written.
    pub enum LogFormat default Text {
        /// For people
        Text = "text",
        /// One JSON object per line
        Json = "json",
    }
}

/// Options of every command.
#[derive(Args, Debug)]
#[command(next_help_heading = "Everywhere")]
pub struct Global {
    /// Print more messages; give it twice for details
    #[arg(short, long, global = true, action = clap::ArgAction::Count, conflicts_with = "quiet")]
    pub verbose: u8,
    /// Print only warnings and errors
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Format of log lines on stderr; RUST_LOG selects the lines
    #[arg(long, global = true, value_parser = named_value_parser::<LogFormat>(), value_name = "FORMAT", default_value = "text")]
    pub log_format: LogFormat,
    /// Show all options
    #[arg(long, global = true, action = clap::ArgAction::HelpLong)]
    help_all: Option<bool>,
    /// Settings file instead of $XDG_CONFIG_HOME/bokehcam/config.toml
    #[arg(long, global = true, value_name = "FILE")]
    pub config: Option<PathBuf>,
}

/// What the blur does.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Blur")]
pub struct Blur {
    /// A look by name: portrait, cinematic, dreamy, product, miniature, or one of your own ([presets.NAME] in the
    /// settings file); individually given settings override it
    #[arg(long, value_name = "NAME")]
    pub preset: Option<String>,
    /// Where depth comes from: auto, recorded, stereo, none, matte, mono, plate, a folder or a depth camera
    #[arg(long, value_name = "FROM", default_value = "auto", long_help = DEPTH)]
    pub depth: DepthChoice,
    /// The look, but for its quality.
    #[command(flatten)]
    pub look: LookSettings<false>,
}

impl Blur {
    /// Whether depth is optional: used if available, else left out without an error.
    pub fn accepts_any_depth(&self) -> bool {
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
    /// Where the blur runs
    #[arg(long, value_parser = named_value_parser::<Backend>(), value_name = "WHICH", default_value = "auto")]
    pub backend: Backend,
    /// GPU to use, by a part of its name
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
    /// Threads of the CPU backend, and of a video's encoder [default: one per core]
    #[arg(long, value_name = "N", value_parser = thread_count_parser())]
    pub threads: Option<usize>,
}

impl Computing {
    /// Converts these options to the library's type.
    pub fn to_compute_options(&self) -> computing::ComputeOptions {
        let Self { backend, adapter, threads, .. } = self.clone();
        computing::ComputeOptions { backend, adapter, threads }
    }
}

/// How a stream runs.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Stream")]
pub struct Stream {
    /// Time that the blur of one frame may take, in milliseconds [default: the frame period]
    #[arg(long, value_name = "MS", value_parser = parse_positive)]
    pub budget_ms: Option<f32>,
    /// Whether frames keep their original timing, or come as fast as possible [default: realtime from a camera or into
    /// a virtual one, else asap]
    #[arg(long, value_parser = named_value_parser::<Pace>(), value_name = "HOW")]
    pub pace: Option<Pace>,
    /// Picture size of a virtual camera; pictures of another size are fitted into it [default: the source's]
    #[arg(long, value_name = "WxH")]
    pub out_size: Option<Size>,
    /// Close the source camera while no program reads the virtual camera
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = false,
          default_missing_value = "true", value_parser = parse_switch, hide_default_value = true)]
    pub on_demand: bool,
    /// Mirror the picture
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = false,
          default_missing_value = "true", value_parser = parse_switch, hide_default_value = true)]
    pub mirror: bool,
    /// Skip and count frames with errors, instead of ending
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = false,
          default_missing_value = "true", value_parser = parse_switch, hide_default_value = true)]
    pub keep_going: bool,
    /// Write a report to this JSON file: the outcome and time of every frame; - is standard output
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
}

/// What may be overwritten.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Output")]
pub struct Output {
    /// Overwrite existing outputs, once the new ones are complete; a folder only if bokehcam wrote all its files
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = false,
          default_missing_value = "true", value_parser = parse_switch, hide_default_value = true)]
    pub force: bool,
}

/// Returns a parser of source names; names of folders may be non-UTF-8.
pub fn source_name_parser() -> impl TypedValueParser<Value = SourceName> {
    OsStringValueParser::new().try_map(|name| SourceName::parse_os(&name))
}

/// Returns a parser of thread counts.
pub fn thread_count_parser() -> impl TypedValueParser<Value = usize> {
    whole_number_parser(1..=1024_usize)
}
