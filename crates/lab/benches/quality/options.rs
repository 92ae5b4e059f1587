//! The command line of the bench.

use std::path::PathBuf;

use bokehcam::budget::Quality;
use clap::Parser;

use super::methods::Method;
use super::scenes::KINDS;

/// Parts of the bench.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Part {
    /// Scenes with exact depth
    Exact,
    /// Some of them with damaged depth
    Damaged,
    /// Moving scenes, with and without background memory
    Moving,
    /// One light on a plain wall
    Highlight,
    /// A static scene with noisy depth
    Flicker,
    /// Portraits from a coarse mask alone
    Masks,
    /// Scenes that are hard for one camera, with a plate and with networks
    Situations,
}

/// Quality of the blur against thin-lens truth, beside other methods
///
/// Truths are rendered once and kept under the target folder. Lower is better for FLIP, higher for the rest.
#[derive(Parser, Debug)]
#[command(
    name = "quality",
    bin_name = "cargo bench --bench quality --",
    after_help = "\
Examples:
  cargo bench --bench quality
  cargo bench --bench quality -- --scenes hair,fence --methods scatter,balanced --out out/
  cargo bench --bench quality -- --markdown > tables.md"
)]
pub struct Options {
    /// Scenes to measure [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = parse_scene)]
    pub scenes: Vec<&'static str>,
    /// Methods to measure [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = parse_method)]
    pub methods: Vec<Method>,
    /// Parts to measure
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        value_enum,
        default_value = "exact,damaged,moving,highlight,flicker,masks,situations"
    )]
    pub parts: Vec<Part>,
    /// Frames of the scenes that move
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..))]
    pub frames: u16,
    /// One JSON object per line, instead of a table
    #[arg(long, conflicts_with = "markdown")]
    pub json: bool,
    /// Tables for the documentation and a verdict, instead of a table (which then goes to stderr)
    #[arg(long)]
    pub markdown: bool,
    /// Folder for pictures: for every scene the picture, the truth, every method, and crops side by side
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// List scenes and methods
    #[arg(long)]
    pub list: bool,
    /// Given by `cargo bench`
    #[arg(long, hide = true)]
    pub bench: bool,
}

impl Options {
    /// Returns the methods to measure, in the order of the tables.
    pub fn methods(&self) -> Vec<Method> {
        Method::all().into_iter().filter(|method| self.methods.is_empty() || self.methods.contains(method)).collect()
    }

    /// Returns whether a scene is to be measured.
    pub fn selects_scene(&self, scene: &str) -> bool {
        self.scenes.is_empty() || self.scenes.contains(&scene)
    }

    /// Returns the method that the crops show, if it is measured.
    pub fn shown_method(&self) -> Option<Method> {
        let default = Method::Layered(Quality::default());
        let methods = self.methods();
        methods.contains(&default).then_some(default).or(methods.last().copied())
    }
}

fn parse_scene(name: &str) -> Result<&'static str, String> {
    let kind = KINDS.iter().find(|kind| kind.name == name);
    kind.map(|kind| kind.name).ok_or_else(|| {
        let names: Vec<_> = KINDS.iter().map(|kind| kind.name).collect();
        format!("there is no such scene: use {}", names.join(", "))
    })
}

fn parse_method(name: &str) -> Result<Method, String> {
    Method::all().into_iter().find(|method| method.name() == name).ok_or_else(|| {
        let names: Vec<_> = Method::all().into_iter().map(Method::name).collect();
        format!("there is no such method: use {}", names.join(", "))
    })
}
