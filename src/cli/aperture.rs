//! `aperture`: what a rank costs in shape, for any aperture (after McGraw's figures 3 to 5).

use std::fs;
use std::path::{Path, PathBuf};

use clap::{Args, value_parser};
use serde::Serialize;

use super::error::CliError;
use super::files::{refuse_overwrite, refuse_source, write_whole};
use super::options::{Global, Output};
use super::{aperture_plot, aperture_sheet, defaults, terminal};
use crate::bokeh::aperture::{Aperture, Mask};
use crate::bokeh::low_rank::Decomposition;
use crate::look::ApertureName;
use crate::look::number::within;
use crate::recording::still::write_color;

/// The error curves end at this rank.
const LAST_PLOTTED_RANK: usize = 16;

/// Analyse how well a few separable terms approximate an aperture
///
/// Writes aperture.json (singular values and errors by rank), errors.svg (error over rank) and one picture per
/// aperture: the kernel, its approximations, and what each has too much (red) or too little (blue).
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  bokehcam aperture --out kernels/
  bokehcam aperture --out kernels/ --apertures disc,polygon:6:15,image:cat.png --ranks 1,2,4
  bokehcam aperture --out soft/ --rim 0.2        (the soft rim that the blur uses)")]
pub struct ApertureCommand {
    /// Folder for the table, the diagram and the pictures
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Apertures, as --aperture of the other commands takes them
    #[arg(long, value_name = "SHAPES", value_delimiter = ',', default_value = defaults::ANALYSED_APERTURES)]
    apertures: Vec<ApertureName>,
    /// Columns and rows of the kernel, 5 to 257
    #[arg(long, value_name = "PX", default_value = defaults::ANALYSED_SIZE, value_parser = value_parser!(u16).range(5..=257))]
    size: u16,
    /// Ranks to show, each 1 to 64, at most 12
    #[arg(long, value_name = "RANKS", value_delimiter = ',', default_value = defaults::ANALYSED_RANKS,
          value_parser = value_parser!(u16).range(1..=64))]
    ranks: Vec<u16>,
    /// Width of the soft rim, as a fraction of the radius; 0 is the hard rim of the paper
    #[arg(id = "analysed_rim", long = "rim", value_name = "W", default_value_t = 0.0, value_parser = within(0.0..=1.0))]
    rim: f32,
    #[command(flatten)]
    output: Output,
}

/// A kernel of unit sum, and its approximations.
pub struct Analysis {
    /// The aperture as it was written.
    pub name: String,
    /// Rows and columns of the kernel.
    pub size: usize,
    /// `size * size` taps, row-major, their sum 1.
    pub kernel: Vec<f64>,
    /// The largest tap: what the errors are relative to.
    pub plateau: f64,
    pub approximations: Vec<Approximation>,
    /// `sqrt(sum_{i>r} sigma_i^2 / sum sigma_i^2)` for r = 1, 2, ...
    pub truncation_errors: Vec<f64>,
    sigma: Vec<f64>,
    numerical_rank: usize,
}

/// A kernel from its first terms, scaled to unit sum again.
pub struct Approximation {
    pub rank: usize,
    /// `size * size` taps, row-major, their sum 1.
    pub taps: Vec<f64>,
    errors: RankErrors,
}

#[derive(Clone, Copy, Debug, Serialize)]
struct RankErrors {
    rank: usize,
    /// Frobenius norm of the difference over that of the kernel, both of unit sum.
    relative_error: f64,
    /// The same before the approximation is scaled to unit sum: the tail of the singular values.
    truncation_error: f64,
    /// Largest absolute difference over the kernel's largest tap.
    largest_error: f64,
    /// Most negative tap over the kernel's largest tap; 0 when there is none.
    most_negative_tap: f64,
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

/// Runs the command.
///
/// # Errors
/// An output exists and `--force` is not given, or cannot be written; an aperture's picture cannot be read.
pub fn run(command: &ApertureCommand, global: &Global) -> Result<(), CliError> {
    let ranks = sorted_ranks(&command.ranks)?;
    let outputs: Vec<PathBuf> = command.apertures.iter().map(|name| command.out.join(picture_name(name))).collect();
    if let Some((index, _)) = outputs.iter().enumerate().find(|(i, path)| outputs[..*i].contains(path)) {
        return Err(CliError::Usage(format!("--apertures: {} is there twice", command.apertures[index])));
    }
    let (table_path, plot_path) = (command.out.join("aperture.json"), command.out.join("errors.svg"));
    let all = outputs.iter().chain([&table_path, &plot_path]);
    for name in &command.apertures {
        if let ApertureName::Image(read) = name {
            all.clone().try_for_each(|file| refuse_source("--out", file, read))?;
        }
    }
    refuse_overwrite(all.map(PathBuf::as_path), command.output.force)?;

    let mut analyses = Vec::new();
    for name in &command.apertures {
        let mask = Aperture { shape: name.load()?, intensity: 0.0 }.mask(usize::from(command.size), command.rim);
        analyses.push(Analysis::of(name.to_string(), &mask, &ranks));
    }
    let table = Table {
        size_px: usize::from(command.size),
        rim: command.rim,
        apertures: analyses.iter().zip(&outputs).map(|(analysis, path)| analysis.row(path)).collect(),
    };
    let json = serde_json::to_vec_pretty(&table).map_err(|error| CliError::io(&table_path)(error.into()))?;
    let plot = aperture_plot::error_by_rank(&analyses, command.size, command.rim)?;

    fs::create_dir_all(&command.out).map_err(CliError::io(&command.out))?;
    for (analysis, path) in analyses.iter().zip(&outputs) {
        write_color(path, &aperture_sheet::draw(analysis), command.output.force)?;
    }
    write_whole(&plot_path, plot.as_bytes())?;
    write_whole(&table_path, &json)?;
    if !global.quiet {
        terminal::say(&format!("{} apertures analysed: {}", analyses.len(), table_path.display()));
    }
    Ok(())
}

fn sorted_ranks(ranks: &[u16]) -> Result<Vec<usize>, CliError> {
    let mut ranks: Vec<usize> = ranks.iter().copied().map(usize::from).collect();
    ranks.sort_unstable();
    ranks.dedup();
    match ranks.len() {
        0..=12 => Ok(ranks),
        many => Err(CliError::Usage(format!("--ranks: {many} are too many for one picture, give at most 12"))),
    }
}

/// A file name that says which aperture it is, whatever characters that has.
fn picture_name(name: &ApertureName) -> String {
    let text = match name {
        ApertureName::Image(file) => format!("image-{}", file.file_stem().unwrap_or_default().to_string_lossy()),
        other => other.to_string(),
    };
    let safe = |c: char| if c.is_ascii_alphanumeric() || c == '.' || c == '_' { c } else { '-' };
    format!("{}.png", text.chars().map(safe).collect::<String>())
}

impl Analysis {
    /// Decomposes a mask and rebuilds it with each of `ranks`.
    pub fn of(name: String, mask: &Mask, ranks: &[usize]) -> Self {
        let svd = Decomposition::of(mask);
        let kernel = unit_sum(&mask.values);
        let plateau = kernel.iter().copied().fold(0.0, f64::max);
        let approximations = ranks
            .iter()
            .map(|&rank| {
                let taps = unit_sum(&svd.approximation(rank));
                let errors = RankErrors::between(&kernel, &taps, plateau, rank, svd.relative_error(rank));
                Approximation { rank, taps, errors }
            })
            .collect();
        Self {
            name,
            size: mask.size,
            plateau,
            approximations,
            truncation_errors: (1..=LAST_PLOTTED_RANK.min(mask.size)).map(|rank| svd.relative_error(rank)).collect(),
            numerical_rank: svd.numerical_rank(),
            sigma: svd.sigma,
            kernel,
        }
    }

    fn row<'a>(&'a self, picture: &Path) -> Row<'a> {
        Row {
            aperture: &self.name,
            picture: picture.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            numerical_rank: self.numerical_rank,
            singular_values: &self.sigma,
            ranks: self.approximations.iter().map(|approximation| approximation.errors).collect(),
        }
    }
}

impl RankErrors {
    fn between(kernel: &[f64], taps: &[f64], plateau: f64, rank: usize, truncation_error: f64) -> Self {
        let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>().sqrt();
        let difference = || kernel.iter().zip(taps).map(|(exact, tap)| tap - exact);
        Self {
            rank,
            relative_error: norm(&mut difference()) / norm(&mut kernel.iter().copied()),
            truncation_error,
            largest_error: difference().map(f64::abs).fold(0.0, f64::max) / plateau,
            most_negative_tap: taps.iter().copied().fold(0.0, f64::min) / plateau,
        }
    }
}

fn unit_sum(taps: &[f64]) -> Vec<f64> {
    let sum: f64 = taps.iter().sum();
    taps.iter().map(|tap| tap / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bokeh::aperture::Aperture;

    #[test]
    fn a_disc_has_the_published_errors() {
        // Antialiased disc of 65 taps: 30.6, 20.3, 15.6 and 12.7 % at rank 1 to 4, lobes of -0.26 and -0.20.
        let analysis = Analysis::of("disc".into(), &Aperture::default().mask(65, 0.0), &[1, 2, 3, 4]);
        for (approximation, percent) in analysis.approximations.iter().zip([30.6, 20.3, 15.6, 12.7]) {
            let errors = approximation.errors;
            assert!((errors.truncation_error * 100.0 - percent).abs() < 0.3, "{errors:?}");
            assert!(errors.relative_error >= errors.truncation_error * 0.99, "{errors:?}");
            assert!((approximation.taps.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
        let lobes: Vec<f64> = analysis.approximations.iter().map(|a| a.errors.most_negative_tap).collect();
        assert!(lobes[0] == 0.0 && (lobes[1] + 0.26).abs() < 0.02 && (lobes[2] + 0.20).abs() < 0.02, "{lobes:?}");
    }

    #[test]
    fn pictures_have_plain_names() {
        for (name, file) in [("polygon:6:15", "polygon-6-15.png"), ("image:/a b/c d.png", "image-c-d.png")] {
            assert_eq!(picture_name(&name.parse().unwrap()), file);
        }
    }
}
