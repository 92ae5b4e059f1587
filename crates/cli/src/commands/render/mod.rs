//! `render`: blurs a still picture.

mod batch;
mod blur;
mod input;
mod listing;
mod map_folder;

use std::fmt::Display;
use std::path::{Path, PathBuf};

use clap::Args;

use input::{FoundDepth, Input, read_input};

use crate::error::CliError;
use crate::files::{
    check_picture_name, create_parent_folder, refuse_overwrite, refuse_overwriting_source, warn_of_leftovers,
};
use crate::focus;
use crate::log;
use crate::options;
use crate::settings::layers::GivenSettings;
use crate::settings::look::RequestedLook;
use crate::settings::unused;
use crate::settings::unused::FrameOrigin;
use crate::terminal;
use bokehcam::compute::Backend;
use bokehcam::depth::agreement::EdgeAlignment;
use bokehcam::depth::backdrop::Background;
use bokehcam::depth::misalignment::Misalignment;
use bokehcam::engine::still::Depth;
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::look::number::whole_number_parser;
use bokehcam::look::{ApertureSetting, Look, LookError, LookFacts, Refine};
use bokehcam::names;
use bokehcam_live::source::photo;
use bokehcam_live::source::{self, DepthChoice, DepthOrigin, PlateFile, SingleCameraDepth};
use bokehcam_media::recording::depth_file::DepthUnit;
use bokehcam_media::recording::snapshot;
use bokehcam_media::recording::still::PhotoFormat;

/// Largest change of a mask, in pixels.
const MAX_MASK_PX: u16 = 200;

/// Blur one still picture, or many
#[derive(Args, Clone, Debug)]
#[command(after_help = "\
Examples:
  bokehcam render photo.jpg --depth-map depth.png --out portrait.png
  bokehcam render photo.jpg --depth-map depth.pfm --focus 0.5,0.4 --aperture polygon:6 --out portrait.png
  bokehcam render photo.jpg --depth matte --out portrait.png
  bokehcam render photo.jpg --mask person.png --out portrait.png
  bokehcam render photo.jpg --depth-map midas.png --depth-unit inverse --out portrait.png
  bokehcam render photo.jpg --effect tilt-shift --tilt 0.6:0.1:10 --out small-world.png
  bokehcam render photo.jpg --effect blur --blur 12 --aperture heart --out hearts.png
  bokehcam render photo.jpg --depth-map depth.png --preset cinematic --out film.png
  bokehcam render shots/ --out blurred/
  bokehcam render --like snapshot.png --rim 0.1 --out another.png")]
pub struct RenderCommand {
    /// The picture (PNG, JPEG, TIFF, WebP and others), or many of them: files, folders, or patterns such as 'shots/*.jpg'
    /// [default: the original picture of the snapshot in --like]
    #[arg(value_name = "IMAGE", required_unless_present = "like")]
    images: Vec<PathBuf>,
    /// The only picture, or that of many that this run blurs.
    #[arg(skip)]
    image: Option<PathBuf>,
    /// Its depth: a grey PNG, JPEG or TIFF, or numbers as TIFF, PFM, NPY, NPZ or EXR; or disparity written by `depth`. For
    /// many pictures a folder, with NAME.png, NAME.pfm or NAME-depth.* for each picture NAME
    #[arg(long, value_name = "FILE")]
    depth_map: Option<PathBuf>,
    /// A mask of the subject, a picture of any size with the photo's aspect ratio, or a square: white is the subject,
    /// which stays sharp, or what is opaque in a picture that was cut out. For many pictures a folder, with NAME.png or
    /// NAME-mask.* for each picture NAME
    #[arg(long, value_name = "FILE", conflicts_with_all = ["depth_map", "like"])]
    mask: Option<PathBuf>,
    /// Move the outline of --mask outwards by this much, in pixels of the picture; inwards if negative. Then it is
    /// fitted to the colours of the picture, unless --refine off is given
    #[arg(long, value_name = "PX", requires = "mask", default_value_t = 0, hide_default_value = true,
          value_parser = whole_number_parser(-i32::from(MAX_MASK_PX)..=i32::from(MAX_MASK_PX)))]
    mask_grow: i32,
    /// Turn the outline of --mask into a gradual transition, of this many pixels on both sides
    #[arg(long, value_name = "PX", requires = "mask", default_value_t = 0, hide_default_value = true,
          value_parser = whole_number_parser(0..=MAX_MASK_PX))]
    mask_feather: u16,
    /// Use the settings of a snapshot, of a preview or a stream; flags override them. Without IMAGE, its NAME-color.png is
    /// blurred, and without --depth-map by its NAME-depth.pfm, which a preview with Reproducible snapshots saves beside
    /// it: this gives the same picture again
    #[arg(long, value_name = "NAME.png")]
    like: Option<PathBuf>,
    /// File for the result, .png, .jpg, .tif or .webp. For many pictures a folder: each result has the name and kind of its picture.
    /// One that is already there is kept, even if it is older than its picture or has other settings, unless --force
    /// is given
    #[arg(long, alias = "to", value_name = "FILE")]
    out: PathBuf,
    /// Format of the results of many pictures, png, jpg, tif or webp [default: that of each picture]
    #[arg(long, value_name = "FORMAT", value_parser = names::parse_name::<PhotoFormat>)]
    out_format: Option<PhotoFormat>,
    #[command(flatten)]
    orientation: options::Orientation,
    #[command(flatten)]
    blur: options::Blur,
    #[command(flatten)]
    depth: options::Depth,
    #[command(flatten)]
    networks: options::Networks,
    #[command(flatten)]
    computing: options::Computing,
    #[command(flatten)]
    output: options::Output,
}

/// Runs the command.
///
/// # Errors
/// Fails if a picture cannot be read or written, the options do not fit it, or the blur fails.
pub fn run(mut command: RenderCommand, global: &options::Global, given: &GivenSettings) -> Result<(), CliError> {
    if listing::is_many(&command.images, &command.out) {
        return batch::run(&command, global, given);
    }
    if let Some(format) = command.out_format {
        let what = format!("--out-format {format}: the name behind --out decides; the option is for many pictures");
        return Err(CliError::Usage(what));
    }
    command.image = command.images.pop();
    check_outputs(&command)?;
    let requested = request_look(&command, given)?;
    check_transparency(&command, &requested.look)?;
    create_parent_folder(&command.out)?;
    warn_of_leftovers([command.out.as_path()]);
    let RenderedFile { executor, depth_by } = render(&command, &requested, given)?;
    if !global.quiet {
        depth_by.iter().for_each(|by| terminal::print_to_stderr(&format!("depth by {by}")));
        terminal::print_to_stderr(&format!("{}: written ({executor})", command.out.display()));
    }
    Ok(())
}

/// Refuses outputs that exist, without `--force`, or that are inputs.
fn check_outputs(command: &RenderCommand) -> Result<(), CliError> {
    check_picture_name("--out", &command.out)?;
    refuse_overwrite([command.out.as_path()], command.output.force)?;
    input_files(command).iter().try_for_each(|source| refuse_overwriting_source("--out", &command.out, source))
}

/// Reads the look, for depth that a picture can have.
fn request_look(command: &RenderCommand, given: &GivenSettings) -> Result<RequestedLook, CliError> {
    let elsewhere = match &command.blur.depth {
        DepthChoice::Folder(path) | DepthChoice::Video(path) => Some(path.display().to_string()),
        DepthChoice::Device(name) => Some(name.clone()),
        DepthChoice::Stereo => Some("stereo".to_owned()),
        _ => None,
    };
    if let Some(name) = elsewhere {
        return Err(CliError::Usage(format!(
            "--depth {name}: {}a folder, two cameras or a depth camera are for `stream`; a picture's depth is given by \
             --depth-map FILE, or made by --depth matte",
            DepthChoice::suggest_keyword(&name)
        )));
    }
    let requested = RequestedLook::new(&command.blur, &command.computing.quality, given)?;
    let look = &requested.look;
    if let Background::Video(video) = &look.background {
        log::note(&format!("--behind video:{}: a picture shows its first frame", video.file().display()));
    }
    Ok(requested)
}

/// Refuses a result that keeps no transparency, if the look's background is transparent.
fn check_transparency(command: &RenderCommand, look: &Look) -> Result<(), CliError> {
    if look.background == Background::Transparent && check_picture_name("--out", &command.out)? == PhotoFormat::Jpeg {
        let out = command.out.display();
        return Err(CliError::Usage(format!(
            "--behind transparent: {out}: JPEG keeps no transparency; use .png, .tif or .webp"
        )));
    }
    Ok(())
}

/// How a picture was rendered.
struct RenderedFile {
    /// Description of the executor.
    executor: String,
    /// Origin of depth that was found in or beside the photo.
    depth_by: Option<String>,
}

/// Blurs the command's only picture, and writes the result.
fn render(command: &RenderCommand, requested: &RequestedLook, given: &GivenSettings) -> Result<RenderedFile, CliError> {
    let Input { mut photo, depth, depth_from, found, notes } = read_input(command, &requested.for_opening())?;
    let facts = command.blur.depth.look_facts(depth.is_some(), depth_from.metres())?;
    // The format of the result has been checked.
    let facts = LookFacts { size: photo.color.size(), keeps_alpha: true, ..facts };
    let look = requested.fit(found.as_ref().and_then(|found| found.focus), &facts);
    let look = look.map_err(|error| match (error, &command.depth_map) {
        (CliError::Look(LookError::Unsuited(what)), Some(file)) if depth_from.is_relative() => {
            let hint = match command.depth.depth_unit {
                Some(DepthUnit::Inverse) => "",
                _ => " (disparity becomes metres by `depth --metres`)",
            };
            CliError::Usage(format!("{}: {what}{hint}", file.display()))
        }
        (error, _) => error,
    })?;
    notes.iter().for_each(|line| log::note(line));
    focus::note_place(&requested.look, &look);
    command.warn_of_settings(&look, &photo.color, (depth.as_ref(), depth_from, found.as_ref()), given);
    let computing = command.computing.to_compute_options();
    let executor = blur::blur(&mut photo, depth, &look, &computing)?;
    let lost = photo.write(&command.out, command.output.force)?;
    if !lost.is_empty() {
        log::note(&format!("not in {}: {}", command.out.display(), lost.join(", ")));
    }
    Ok(RenderedFile { executor, depth_by: found.map(|found| found.by) })
}

impl RenderCommand {
    /// Returns the options for finding or computing the picture's depth.
    fn source_options(&self) -> source::Options {
        source::Options {
            // Only depth cameras have a calibration file.
            depth: options::Depth { depth_calibration: None, ..self.depth.clone() },
            frames: options::Frames { orientation: self.orientation, ..options::Frames::default() },
            networks: self.networks.clone(),
            depth_choice: self.blur.depth.clone(),
            computing: self.computing.to_compute_options(),
            ..source::Options::default()
        }
    }

    /// Warns of settings without effect, and of a focus outside the picture's depth.
    fn warn_of_settings(
        &self,
        look: &Look,
        color: &ColorImage,
        (depth, depth_from, found): (Option<&Depth>, DepthOrigin, Option<&FoundDepth>),
        given: &GivenSettings,
    ) {
        let uses_depth = look.effect.follows_depth();
        unused::warn_of_unused(
            &given.settings,
            &unused::RunFacts { cpu_only: self.computing.backend == Backend::Cpu, ..unused::RunFacts::default() }
                .for_look(FrameOrigin::Picture, depth_from, look),
        );
        if self.mask.is_some() {
            self.depth.describe_unused("that of a mask").iter().for_each(|unused| log::warn(unused));
        }
        match depth {
            None if self.blur.accepts_any_depth() => unused::warn_of_no_depth(FrameOrigin::Picture),
            Some(_) if self.depth_map.is_some() && !uses_depth => {
                log::warn("--depth-map has no effect: the effect does not use depth");
            }
            Some(Depth::Measured(map) | Depth::Final(map)) => {
                focus::warn_of_distances(look, color.size(), map, depth_from, self.depth.depth_scale);
            }
            None => {}
        }
        let map_name = self.depth_map.as_ref().map(|file| file.display().to_string());
        let file = map_name.or_else(|| found.filter(|found| found.measured).map(|found| found.by.clone()));
        if let (Some(Depth::Measured(map)), Some(file), true) = (depth, file, uses_depth) {
            report_misalignment(&file, look, map, color);
        }
    }
}

/// Reports a misalignment between a depth map and its picture, and its correction.
fn report_misalignment(file: &dyn Display, look: &Look, map: &DepthMap, color: &ColorImage) {
    let Some(misalignment) = Misalignment::measure(map, color) else { return };
    if misalignment.outlines == EdgeAlignment::Unrelated {
        log::warn(&format!(
            "{file}: none of its outlines match those of the picture: it may be the depth of another picture, or of \
             another camera that is not registered to the colours"
        ));
    } else if look.refine == Refine::Auto {
        log::note(&format!("{file}: refined, as {misalignment}; --refine off uses it unchanged"));
    }
}

/// Lists all input files, which the outputs must not replace.
fn input_files(command: &RenderCommand) -> Vec<PathBuf> {
    let snapshot_files = command.like.iter().flat_map(|like| {
        let (color, depth) = snapshot::source_paths(like);
        [like.clone(), color, depth]
    });
    let aperture = match &command.blur.look.0.aperture {
        Some(ApertureSetting::Image(file)) => Some(file),
        _ => None,
    };
    let plate = match &command.blur.depth {
        DepthChoice::SingleCamera(SingleCameraDepth { plate: Some(PlateFile::At(file)), .. }) => Some(file),
        _ => None,
    };
    [&command.image, &command.depth_map, &command.mask]
        .into_iter()
        .flatten()
        .chain(plate)
        .chain(aperture)
        .cloned()
        .chain(command.blur.look.0.behind.iter().filter_map(|behind| behind.file().map(Path::to_owned)))
        .chain(command.image.iter().flat_map(|image| photo::photo_files(image)))
        .chain(snapshot_files)
        .collect()
}
