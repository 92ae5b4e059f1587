//! The command line of the bench.

use std::path::PathBuf;

use bokehcam::depth::stereo::Effort;
use clap::{Args, Parser, Subcommand, value_parser};

/// Stereo depth: time, flicker, and the resulting blur
#[derive(Parser, Debug)]
#[command(
    name = "stereo",
    bin_name = "cargo bench --bench stereo --",
    after_help = "\
Examples:
  cargo bench --bench stereo -- times --size 640x480 --disparities 64 --threads 1,2
  cargo bench --bench stereo -- times left.png right.png --disparities 128 --json
  cargo bench --bench stereo -- flicker
  cargo bench --bench stereo -- picture --rival sgbm5=/tmp/opencv/sgbm5
  cargo bench --bench stereo -- steps --out docs/stereo"
)]
pub struct Options {
    /// What to measure
    #[command(subcommand)]
    pub command: Option<Command>,
    /// Efforts to measure
    #[arg(long, global = true, value_name = "LIST", value_delimiter = ',', default_value = "full,fast", value_parser = parse_effort)]
    pub efforts: Vec<Effort>,
    /// Match on a GPU; one whose name contains this, if it is not empty
    #[arg(long, global = true, value_name = "NAME", num_args = 0..=1, default_missing_value = "")]
    pub gpu: Option<String>,
    /// One JSON object per line
    #[arg(long, global = true)]
    pub json: bool,
    /// Given by `cargo bench`
    #[arg(long, hide = true, global = true)]
    pub bench: bool,
}

/// The measurements.
#[derive(Subcommand, Debug)]
pub enum Command {
    /// Time of the matcher, in this process, one pair after the other
    Times(Times),
    /// Steadiness of the disparity, with the memory of earlier frames and without
    Flicker(Flicker),
    /// The blur from stereo depth against the pictures of a real lens
    Picture(Picture),
    /// Pictures of every step
    Steps {
        /// Folder for them
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
}

/// Options of `times`.
#[derive(Args, Debug)]
pub struct Times {
    /// Files of the left and the right picture [default: the bundled recording's first pair, brought to --size]
    #[arg(num_args = 2, value_names = ["LEFT", "RIGHT"])]
    pub pair: Vec<PathBuf>,
    /// Sizes of the bundled pair
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "640x480,1280x720", value_parser = parse_size)]
    pub size: Vec<(u32, u32)>,
    /// Disparities tried: a multiple of 16
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "64", value_parser = value_parser!(u32).range(16..=256))]
    pub disparities: Vec<u32>,
    /// Threads
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "1,2")]
    pub threads: Vec<usize>,
    /// Pairs matched by each, all in turn
    #[arg(long, value_name = "N", default_value_t = 9, value_parser = value_parser!(u32).range(1..))]
    pub rounds: u32,
}

/// Options of `flicker`.
#[derive(Args, Debug)]
pub struct Flicker {
    /// Standard deviation of the noise that is put on the bundled recording, which has none, in 8-bit codes
    #[arg(long, value_name = "CODES", default_value_t = 2.0)]
    pub noise: f32,
    /// Folder with stereo_seq/ [default: $BOKEHCAM_DATA; without, the bundled recording alone]
    #[arg(long, value_name = "DIR", env = "BOKEHCAM_DATA")]
    pub data: Option<PathBuf>,
}

/// Options of `picture`.
#[derive(Args, Debug)]
pub struct Picture {
    /// Another matcher's disparity of the bundled recording: a folder of NNNNNN.pfm
    #[arg(long = "rival", value_name = "NAME=DIR", value_parser = parse_rival)]
    pub rivals: Vec<(String, PathBuf)>,
    /// Folder for the blurred pictures
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Returns the name on the product's command line.
pub fn effort_name(effort: Effort) -> &'static str {
    match effort {
        Effort::Fast => "fast",
        Effort::Full => "full",
    }
}

fn parse_effort(text: &str) -> Result<Effort, String> {
    let found = [Effort::Fast, Effort::Full].into_iter().find(|&effort| effort_name(effort) == text);
    found.ok_or_else(|| "use full or fast".to_owned())
}

fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let sides = text.split_once('x').and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    sides.filter(|&(width, height)| width > 0 && height > 0).ok_or_else(|| "use WIDTHxHEIGHT".to_owned())
}

fn parse_rival(text: &str) -> Result<(String, PathBuf), String> {
    let (name, folder) = text.split_once('=').ok_or("use NAME=DIR")?;
    Ok((name.to_owned(), folder.into()))
}
