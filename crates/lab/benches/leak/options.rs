//! The command line of the bench.

use std::path::PathBuf;

use crate::experiment::card::{Card, Kind};
use bokehcam::budget::Quality;
use clap::{Parser, value_parser};

use super::channel::Channel;

/// What of a background can be read again after the blur of a call
///
/// Draws cards with text of 14 to 56 px on a wall behind a person, blurs them as a call does, and attacks the result by
/// deconvolution. Prints Pearson's correlation with the sharp card in linear light for each row; reading begins at 0.6.
#[derive(Parser, Debug)]
#[command(
    name = "leak",
    bin_name = "cargo bench --bench leak --",
    after_help = "\
Paths that are not absolute begin at crates/lab.

Examples:
  cargo bench --bench leak
  cargo bench --bench leak -- --radii 16 --cards dark --channels still,moving --out /tmp/restored
  cargo bench --bench leak -- --write-card /tmp/card.png
  cargo bench --bench leak -- /tmp/blurred-by-another-program.png /tmp/recorded-call.mkv"
)]
pub struct Options {
    /// Pictures, folders of pictures, or videos of the card as another program shows it, at rest [default: bokehcam's blur]
    #[arg(value_name = "SOURCE")]
    pub sources: Vec<PathBuf>,
    /// Cards: dark or light text, or a poster; of a SOURCE, the one that it shows
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "dark,light,poster")]
    pub cards: Vec<Kind>,
    /// Words on the card
    #[arg(long, value_name = "TEXT", default_value = "MEETING WITH ACME 14:30  pin 4821")]
    pub words: String,
    /// Size of the card, in pixels
    #[arg(long, value_name = "WxH", default_value = "960x540", value_parser = parse_size)]
    pub size: (u32, u32),
    /// Blur radii of the wall, in pixels
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "8,11,16,24", value_parser = parse_radius)]
    pub radii: Vec<f32>,
    /// Ways to the attacker: a camera at rest or hand-held, as it is or through a codec at 1 Mbit/s
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "still,still-x264,still-vp8,moving,moving-x264,moving-vp8"
    )]
    pub channels: Vec<Channel>,
    /// Quality of the blur
    #[arg(long, value_name = "LEVEL", default_value_t)]
    pub quality: Quality,
    /// Frames that are registered and averaged, of a camera that moves or a codec
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = value_parser!(u16).range(1..=1000))]
    pub frames: u16,
    /// Iterations of Richardson-Lucy
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = value_parser!(u16).range(10..=1000))]
    pub iterations: u16,
    /// Folder for the pictures, before and after the best attack
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Write the card for other programs, and its depth map beside it
    #[arg(long, value_name = "FILE.png", conflicts_with = "sources")]
    pub write_card: Option<PathBuf>,
    /// Given by `cargo bench`
    #[arg(long, hide = true)]
    pub bench: bool,
}

impl Options {
    /// Returns a card as asked for.
    pub fn card(&self, kind: Kind) -> Card {
        Card::new(kind, self.size, &self.words)
    }
}

fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let side = |text: &str| text.parse().ok().filter(|side| (240..=4096).contains(side));
    let size = text.split_once('x').and_then(|(width, height)| side(width).zip(side(height)));
    size.ok_or_else(|| "use WIDTHxHEIGHT, each from 240 to 4096".to_owned())
}

fn parse_radius(text: &str) -> Result<f32, String> {
    let radius = text.parse().ok().filter(|radius_px| (4.0..=64.0).contains(radius_px));
    radius.ok_or_else(|| "use radii from 4 to 64 px".to_owned())
}
