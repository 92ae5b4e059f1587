//! `depth`: the disparity of one stereo pair, or its depth.

mod inside;
mod preview;

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;

use crate::error::CliError;
use crate::files::{create_parent_folder, refuse_overwrite, refuse_overwriting_source, warn_of_leftovers};
use crate::log;
use crate::options;
use crate::terminal;
use bokehcam::calibration::rectifier::Rectifier;
use bokehcam::compute::Backend;
use bokehcam::computing::ComputeOptions;
use bokehcam::depth::DepthError;
use bokehcam::depth::stereo::check::{Verdict, check_pair};
use bokehcam::depth::stereo::{Effort, MatchError, Pair, Settings};
use bokehcam::frame::{ColorImage, DepthMap, DisparityMap, GrayImage};
use bokehcam::look::number::{in_range_parser, parse_positive, whole_number_parser};
use bokehcam::optics::StereoRig;
use bokehcam_live::source::calib::{self, PairCalibration};
use bokehcam_live::source::options::DEPTH_SCALE;
use bokehcam_live::source::photo;
use bokehcam_media::recording::geometry::Geometry;
use bokehcam_media::recording::still::{self, MapFormat};

use preview::colorize_disparity;

/// Default search range, if neither `--max-disparity` nor the calibration sets it.
const DEFAULT_DISPARITIES: u32 = 64;

/// Find the disparity of a rectified stereo pair, or its depth
///
/// The disparity belongs to the left picture: its pixel x is at x - disparity in the right one. Both pictures are
/// rectified (a point is in the same row of both), or are rectified first by the calibration.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  bokehcam depth im0.png im1.png --calib calib.txt --out disparity.pfm --preview disparity.png
  bokehcam depth left.png right.png --max-disparity 128 --out disparity.png
  bokehcam depth phone.jpg --out depth.pfm
  bokehcam depth left.png right.png --focal-px 707 --baseline-m 0.54 --metres --out depth.pfm")]
pub struct DepthCommand {
    /// Picture of the left camera
    left: PathBuf,
    /// Picture of the right camera; without it, LEFT is a photo of a phone, whose own depth is extracted
    right: Option<PathBuf>,
    /// File for the result: .pfm (float pixels, infinity = unknown) or .png (16 bits, 256 units per pixel, 0 = unknown)
    #[arg(long, alias = "to", value_name = "FILE")]
    out: PathBuf,
    /// Range of disparities to search, from 0, in pixels; rounded up to a multiple of 16 [default: the calibration's,
    /// else 64]
    // Distinct ids: the settings of the same names belong to live sources.
    #[arg(id = "pair_max_disparity", long = "max-disparity", value_name = "PX",
          value_parser = whole_number_parser(1..=Settings::MAX_DISPARITIES))]
    max_disparity: Option<u32>,
    /// Calibration of the two cameras, of OpenCV, ROS, Kalibr, EuRoC, ZED or OAK-D to rectify the pictures,
    /// or the calib.txt of a rectified pair of Middlebury, ETH3D or KITTI; may be given more than once, or as a list
    /// with commas, for a calibration in two files
    #[arg(id = "pair_calib", long = "calib", value_name = "FILE", value_delimiter = ',')]
    calib: Vec<PathBuf>,
    /// Focal length in pixels, with --baseline-m
    #[arg(id = "pair_focal_px", long = "focal-px", value_name = "PX", value_parser = parse_positive,
          conflicts_with = "pair_calib", requires = "pair_baseline_m")]
    focal_px: Option<f32>,
    /// Distance between the cameras in metres: with --focal-px, or instead of the one in --calib
    #[arg(id = "pair_baseline_m", long = "baseline-m", value_name = "M", value_parser = parse_positive)]
    baseline_m: Option<f32>,
    /// Column of the right principal point minus that of the left, in pixels [default: 0]
    #[arg(id = "pair_doffs_px", long = "doffs-px", value_name = "PX", value_parser = in_range_parser(-10_000.0..=10_000.0),
          conflicts_with = "pair_calib", requires = "pair_focal_px")]
    doffs_px: Option<f32>,
    /// Write depth in metres instead: .pfm, or .png of 5000 units per metre (TUM); 0 = unknown
    #[arg(long)]
    metres: bool,
    /// Also write the disparity as a picture: near is red, far is blue, unknown is black
    #[arg(long, value_name = "FILE.png")]
    preview: Option<PathBuf>,
    /// Effort of the matching
    #[arg(long, value_parser = options::named_value_parser::<Effort>(), value_name = "HOW", default_value = "full")]
    effort: Effort,
    /// Where the matching runs
    #[arg(long, value_parser = options::named_value_parser::<Backend>(), value_name = "WHICH", default_value = "auto", help_heading = "Computing")]
    backend: Backend,
    /// GPU to use, by a part of its name
    #[arg(long, value_name = "NAME", help_heading = "Computing")]
    adapter: Option<String>,
    /// Threads of the CPU backend [default: one per core]
    #[arg(long, value_name = "N", help_heading = "Computing", value_parser = options::thread_count_parser())]
    threads: Option<usize>,
    #[command(flatten)]
    output: options::Output,
}

/// Runs the command.
///
/// # Errors
/// Fails if a file cannot be read or written, the pictures differ in size, the options do not fit them, or no GPU
/// matches.
pub fn run(command: &DepthCommand, global: &options::Global) -> Result<(), CliError> {
    command.check_options()?;
    let note = |text: String| {
        if !global.quiet {
            terminal::print_to_stderr(&format!("note: {text}"));
        }
    };
    let Some(right) = &command.right else { return inside::extract(command, global) };
    let mut color = still::read_color(&command.left)?;
    let mut right = to_luma(&still::read_color(right)?);
    let size = color.size();
    if right.size() != size {
        return Err(DepthError::from(MatchError::Sizes { left: size, right: right.size() }).into());
    }
    let (geometry, rectifier) = command.resolve_geometry(size, &note)?;
    if let Some(rectifier) = &rectifier {
        rectifier.rectify_left(&std::mem::take(&mut color), &mut color);
        rectifier.rectify_right(&std::mem::take(&mut right), &mut right);
        note("the pictures are rectified by the calibration: the result belongs to the rectified left picture".into());
    }
    let left = to_luma(&color);
    let disparities =
        command.resolve_disparity_range(geometry.and_then(|geometry| geometry.disparity_count), size.0, &note)?;
    let (adapter, threads) = (command.adapter.clone(), command.threads);
    let computing = ComputeOptions { backend: command.backend, adapter, threads };
    let mut matcher = computing.create_matcher(disparities, command.effort, size)?;
    let mut disparity = DisparityMap::default();
    let start = Instant::now();
    let pair = Pair { left: &left, color: Some(&color), right: &right };
    matcher.compute_disparity(pair, &mut disparity).map_err(DepthError::from)?;
    let took_ms = start.elapsed().as_secs_f64() * 1e3;

    report_pair(
        check_pair(&left, &right, disparities).map_err(DepthError::from)?.verdict(),
        rectifier.is_some(),
        &note,
    );
    command.write(&disparity, geometry.map(|geometry| geometry.rig), &note)?;
    if !global.quiet {
        let (width, height) = size;
        terminal::print_to_stderr(&format!(
            "{}: written ({width}x{height}, {disparities} disparities, {took_ms:.1} ms, {})",
            command.out.display(),
            matcher.describe()
        ));
    }
    Ok(())
}

/// Says that the pair is misaligned, swapped or one picture: the result alone looks plausible.
fn report_pair(verdict: Verdict, is_calibrated: bool, note: &dyn Fn(String)) {
    match verdict {
        Verdict::Misaligned { .. } => note(format!(
            "{verdict}, and the disparity is wrong; {}",
            match is_calibrated {
                true => "the calibration does not match the position of the cameras: calibrate them again",
                false => "rectify it with the --calib FILE of raw cameras",
            }
        )),
        Verdict::Swapped => note(verdict.to_string()),
        Verdict::Identical => log::warn(&verdict.to_string()),
        Verdict::Rectified | Verdict::Unclear { .. } => {}
    }
}

impl DepthCommand {
    /// Writes disparity or depth, and the preview.
    fn write(&self, disparity: &DisparityMap, rig: Option<StereoRig>, note: &dyn Fn(String)) -> Result<(), CliError> {
        let force = self.output.force;
        create_parent_folder(&self.out)?;
        warn_of_leftovers([self.out.as_path()]);
        match rig.filter(|_| self.metres) {
            Some(rig) => {
                let depth = disparity.to_depth_map(|px| rig.depth_m(px));
                note_out_of_range_depth(&self.out, &depth, note)?;
                still::write_depth(&self.out, &depth, DEPTH_SCALE, force)?;
            }
            None => still::write_disparity(&self.out, disparity, rig, force)?,
        }
        if let Some(file) = &self.preview {
            create_parent_folder(file)?;
            still::write_color(file, &colorize_disparity(disparity), force)?;
        }
        Ok(())
    }

    /// Rejects conflicting options and files before reading any picture.
    fn check_options(&self) -> Result<(), CliError> {
        let usage = |text: &str| Err(CliError::Usage(text.to_string()));
        let is_stereo = self.metres
            || self.preview.is_some()
            || self.max_disparity.is_some()
            || self.focal_px.is_some()
            || !self.calib.is_empty();
        if self.right.is_none() && is_stereo {
            return usage(
                "--metres, --preview, --max-disparity, --calib and --focal-px are for two pictures: add that of the right \
                 camera",
            );
        }
        if self.metres && self.calib.is_empty() && self.focal_px.is_none() {
            return usage("--metres needs the stereo geometry: give --calib FILE, or --focal-px and --baseline-m");
        }
        if self.baseline_m.is_some() && self.calib.is_empty() && self.focal_px.is_none() {
            return usage("--baseline-m needs --focal-px, or --calib FILE whose baseline it replaces");
        }
        if still::map_format(&self.out).is_err() {
            return usage("--out FILE ends with .pfm or .png");
        }
        let is_png = |file: &PathBuf| file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
        if !self.preview.as_ref().is_none_or(is_png) {
            return usage("--preview FILE.png ends with .png");
        }
        if self.preview.as_ref() == Some(&self.out) {
            return usage("--preview and --out name the same file; each needs its own");
        }
        let inputs = || [&self.left].into_iter().chain(&self.right);
        let hides = |preview: &&PathBuf| inputs().find(|photo| photo::is_depth_file_of(preview, photo));
        if let Some((preview, photo)) = self.preview.as_ref().and_then(|preview| Some((preview, hides(&preview)?))) {
            let stem = photo.file_stem().unwrap_or_default().display();
            return Err(CliError::Usage(format!(
                "--preview {}: a picture in colours by this name would be taken for the depth map of {}; use another, such \
                 as {}",
                preview.display(),
                photo.display(),
                preview.with_file_name(format!("{stem}-preview.png")).display()
            )));
        }
        for read in inputs().chain(&self.calib) {
            refuse_overwriting_source("--out", &self.out, read)?;
            self.preview.as_ref().map_or(Ok(()), |preview| refuse_overwriting_source("--preview", preview, read))?;
        }
        refuse_overwrite([self.out.as_path()].into_iter().chain(self.preview.as_deref()), self.output.force)
    }

    /// Returns the stereo geometry for pictures of `size`, if options or calibration define it, and the rectifier for
    /// raw pictures.
    fn resolve_geometry(
        &self,
        size: (u32, u32),
        note: &dyn Fn(String),
    ) -> Result<(Option<Geometry>, Option<Rectifier>), CliError> {
        let from_rig = |rig| Geometry { rig, size: None, disparity_count: None };
        if self.calib.is_empty() {
            let doffs_px = self.doffs_px.unwrap_or(0.0);
            let rig = |(focal_px, baseline_m)| StereoRig { focal_px, baseline_m, doffs_px, metric: true };
            return Ok((self.focal_px.zip(self.baseline_m).map(rig).map(from_rig), None));
        }
        let calibration = calib::read_pair_calibration(&self.calib, &self.left, size, self.baseline_m)?;
        let origin = if self.baseline_m.is_some() { "--baseline-m" } else { "by the calibration" };
        let baseline = format!("the cameras are {:.1} mm apart ({origin})", calibration.baseline_m() * 1e3);
        match calibration {
            PairCalibration::Rectified { geometry, made_for } => {
                note(baseline);
                if let Some((width, height)) = made_for.filter(|&made_for| made_for != size) {
                    let file = self.calib[0].display();
                    note(format!("{file} is for pictures of {width}x{height}: scaled to {}x{}", size.0, size.1));
                }
                Ok((Some(geometry), None))
            }
            PairCalibration::Raw(calibration) => {
                let rectifier = Rectifier::new(&calibration, size)?;
                note(baseline);
                calibration.describe_doubt().iter().for_each(|doubt| log::warn(doubt));
                calibration.describe_assumptions(size).into_iter().for_each(note);
                Ok((Some(from_rig(rectifier.rig())), Some(rectifier)))
            }
        }
    }

    /// Returns the search range for pictures `width` px wide: `--max-disparity`, else the `calibrated` one, else
    /// [`DEFAULT_DISPARITIES`], limited by the width. The matcher needs a multiple of 16.
    fn resolve_disparity_range(
        &self,
        calibrated: Option<u32>,
        width: u32,
        note: &dyn Fn(String),
    ) -> Result<u32, CliError> {
        // A disparity is less than the width.
        let limit = (width.saturating_sub(1) / 16 * 16).min(Settings::MAX_DISPARITIES);
        if limit == 0 {
            return Err(CliError::Usage(format!("the pictures are {width} px wide, and matching needs 17 or more")));
        }
        if let Some(asked) = self.max_disparity {
            let rounded = asked.next_multiple_of(16);
            if rounded > limit {
                return Err(CliError::Usage(format!(
                    "--max-disparity {asked} does not fit pictures {width} px wide: use at most {limit}"
                )));
            }
            if rounded != asked {
                note(format!("--max-disparity {asked} is rounded up to {rounded}, a multiple of 16"));
            }
            return Ok(rounded);
        }
        let (wanted, whose) = match calibrated {
            Some(calibrated) => (calibrated, "the calibration's"),
            None => (DEFAULT_DISPARITIES, "assumed: --max-disparity says how many"),
        };
        let tried = wanted.min(limit);
        if tried < wanted {
            note(format!(
                "{wanted} disparities ({whose}), but at most {limit} can be searched: nearer surfaces are missed"
            ));
        } else {
            note(format!("{tried} disparities ({whose})"));
        }
        Ok(tried)
    }
}

fn to_luma(color: &ColorImage) -> GrayImage {
    let mut luma = GrayImage::default();
    luma.set_luma_from(color);
    luma
}

/// Notes the percentage of pixels beyond the range of a 16-bit PNG.
fn note_out_of_range_depth(out: &Path, depth: &DepthMap, note: &dyn Fn(String)) -> Result<(), CliError> {
    let limit_m = f32::from(u16::MAX) / DEPTH_SCALE;
    let beyond = depth.metres.iter().filter(|&&metres| metres > limit_m).count();
    if still::map_format(out)? == MapFormat::Png && beyond > 0 {
        let percent = 100.0 * beyond as f32 / depth.metres.len() as f32;
        note(format!(
            "{percent:.1} % lies beyond {limit_m:.1} m, too far for a .png, and is stored as unknown; use a .pfm"
        ));
    }
    Ok(())
}
