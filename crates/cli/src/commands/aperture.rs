//! `aperture`: the approximation error of any aperture by separable rank (after McGraw's figures 3 to 5).

use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use crate::error::CliError;
use crate::files::{refuse_overwrite, refuse_overwriting_source, write_atomically};
use crate::options::{Global, Output};
use crate::terminal;
use bokehcam::bokeh::aperture::Aperture;
use bokehcam::look::ApertureSetting;
use bokehcam::look::number::{in_range_parser, whole_number_parser};
use bokehcam_media::recording::still::write_color;

use bokehcam_lab::aperture::{Analysis, RankErrors, draw_sheet, plot_error_by_rank};

/// Analyse how well a few separable terms approximate an aperture
///
/// Writes aperture.json (singular values and errors by rank), errors.svg (error over rank) and one picture per
/// aperture: the kernel, its approximations, and where each is too bright (red) or too dark (blue).
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  bokehcam aperture --out kernels/
  bokehcam aperture --out kernels/ --apertures disc,polygon:6:15,image:cat.png --ranks 1,2,4
  bokehcam aperture --out soft/ --rim 0.2        (the soft rim of the default blur)")]
pub struct ApertureCommand {
    /// Folder for the table, the diagram and the pictures
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Apertures, written as for --aperture of the other commands
    #[arg(
        long,
        value_name = "SHAPES",
        value_delimiter = ',',
        default_value = "disc,ring:0.5,polygon:5,polygon:6,polygon:8,heart,star:5"
    )]
    apertures: Vec<ApertureSetting>,
    /// Columns and rows of the kernel, 5 to 257
    #[arg(long, value_name = "PX", default_value = "65", value_parser = whole_number_parser(5..=257_u16))]
    size: u16,
    /// Ranks to show, each 1 to 64, at most 12
    #[arg(long, value_name = "RANKS", value_delimiter = ',', default_value = "1,2,3,4,6,8",
          value_parser = whole_number_parser(1..=64_u16))]
    ranks: Vec<u16>,
    /// Width of the soft rim, as a fraction of the radius; 0 is the hard rim of the paper
    #[arg(id = "analysed_rim", long = "rim", value_name = "W", default_value_t = 0.0, value_parser = in_range_parser(0.0..=1.0))]
    rim: f32,
    #[command(flatten)]
    output: Output,
}

#[derive(Serialize)]
struct Table<'a> {
    size_px: usize,
    rim: f32,
    apertures: Vec<Row<'a>>,
}

#[derive(Serialize)]
struct Row<'a> {
    aperture: &'a str,
    picture: String,
    numerical_rank: usize,
    singular_values: &'a [f64],
    ranks: Vec<RankErrors>,
}

impl<'a> Row<'a> {
    fn new(analysis: &'a Analysis, picture: &Path) -> Self {
        Self {
            aperture: &analysis.name,
            picture: picture.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            numerical_rank: analysis.numerical_rank,
            singular_values: &analysis.sigma,
            ranks: analysis.approximations.iter().map(|approximation| approximation.errors).collect(),
        }
    }
}

/// Runs the command.
///
/// # Errors
/// Fails if an output exists without `--force` or cannot be written, or an aperture's picture cannot be read.
pub fn run(command: &ApertureCommand, global: &Global) -> Result<(), CliError> {
    let ranks = parse_ranks(&command.ranks)?;
    let outputs: Vec<PathBuf> =
        command.apertures.iter().map(|name| command.out.join(picture_file_name(name))).collect();
    if let Some((index, _)) = outputs.iter().enumerate().find(|(i, path)| outputs[..*i].contains(path)) {
        return Err(CliError::Usage(format!("--apertures: {} is there twice", command.apertures[index])));
    }
    let (table_path, plot_path) = (command.out.join("aperture.json"), command.out.join("errors.svg"));
    let all = outputs.iter().chain([&table_path, &plot_path]);
    for name in &command.apertures {
        if let ApertureSetting::Image(read) = name {
            all.clone().try_for_each(|file| refuse_overwriting_source("--out", file, read))?;
        }
    }
    refuse_overwrite(all.map(PathBuf::as_path), command.output.force)?;

    // Everything is computed before the first file is written.
    let mut analyses = Vec::new();
    for name in &command.apertures {
        let mask = Aperture { shape: name.load()?, intensity: 0.0 }.to_mask(usize::from(command.size), command.rim);
        analyses.push(Analysis::new(name.to_string(), &mask, &ranks));
    }
    let table = Table {
        size_px: usize::from(command.size),
        rim: command.rim,
        apertures: analyses.iter().zip(&outputs).map(|(analysis, path)| Row::new(analysis, path)).collect(),
    };
    let json = serde_json::to_vec_pretty(&table).map_err(|error| CliError::io(&table_path)(error.into()))?;
    let plot = plot_error_by_rank(&analyses, command.size, command.rim).map_err(CliError::Diagram)?;

    fs::create_dir_all(&command.out).map_err(CliError::io(&command.out))?;
    for (analysis, path) in analyses.iter().zip(&outputs) {
        write_color(path, &draw_sheet(analysis), command.output.force)?;
    }
    write_atomically(&plot_path, plot.as_bytes(), command.output.force)?;
    write_atomically(&table_path, &json, command.output.force)?;
    if !global.quiet {
        terminal::print_to_stderr(&format!("{} apertures analysed: {}", analyses.len(), table_path.display()));
    }
    Ok(())
}

fn parse_ranks(ranks: &[u16]) -> Result<Vec<usize>, CliError> {
    let mut ranks: Vec<usize> = ranks.iter().copied().map(usize::from).collect();
    ranks.sort_unstable();
    ranks.dedup();
    match ranks.len() {
        0..=12 => Ok(ranks),
        many => Err(CliError::Usage(format!("--ranks: {many} are too many for one picture; give at most 12"))),
    }
}

/// Returns a file name for the aperture, safe for any characters in its own name.
fn picture_file_name(name: &ApertureSetting) -> String {
    let text = match name {
        ApertureSetting::Image(file) => format!("image-{}", file.file_stem().unwrap_or_default().to_string_lossy()),
        other => other.to_string(),
    };
    let safe = |c: char| if c.is_ascii_alphanumeric() || c == '.' || c == '_' { c } else { '-' };
    format!("{}.png", text.chars().map(safe).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_have_plain_names() {
        for (name, file) in [("polygon:6:15", "polygon-6-15.png"), ("image:/a b/c d.png", "image-c-d.png")] {
            assert_eq!(picture_file_name(&name.parse().unwrap()), file);
        }
    }
}
