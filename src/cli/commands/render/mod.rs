//! `render`: one still picture.

mod debug;
mod debug_pictures;

use std::fmt::Display;
use std::path::{Path, PathBuf};

use clap::Args;

use crate::cli::error::CliError;
use crate::cli::files::{make_folder_of, refuse_overwrite, refuse_source};
use crate::cli::focus;
use crate::cli::log;
use crate::cli::options;
use crate::cli::plausible;
use crate::cli::settings::layers::Given;
use crate::cli::settings::look;
use crate::cli::settings::unused;
use crate::cli::settings::unused::From;
use crate::cli::terminal;
use crate::compute::Backend;
use crate::depth::agreement::Agreement;
use crate::depth::defocus;
use crate::depth::matting::mask;
use crate::depth::misfit::Misfit;
use crate::files::place;
use crate::frame::{ColorImage, DepthMap, Mask};
use crate::look::{ApertureName, Look, Refine, Strength};
use crate::optics::StereoRig;
use crate::pipeline::{self, still::Depth};
use crate::recording::still::{self, MapFormat, PhotoFormat};
use crate::recording::{Extras, snapshot};
use crate::source::options::DepthUnit;
use crate::source::{self, DepthChoice, DepthFrom, OneCamera, PlateFile};

/// Blur one still picture
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  bokehcam render photo.jpg --depth-map depth.png --out portrait.png
  bokehcam render photo.jpg --depth-map depth.pfm --focus 0.5,0.4 --aperture polygon:6 --out portrait.png
  bokehcam render photo.jpg --depth matte --out portrait.png
  bokehcam render photo.jpg --mask person.png --out portrait.png
  bokehcam render photo.jpg --depth-map midas.png --depth-unit inverse --out portrait.png
  bokehcam render photo.jpg --effect tilt-shift --tilt 0.6:0.1:10 --out small-world.png
  bokehcam render photo.jpg --effect blur --coc-at-infinity 12 --aperture heart --out hearts.png
  bokehcam render photo.jpg --depth-map depth.png --out portrait.png --debug-dir within/
  bokehcam render photo.jpg --depth-map depth.png --preset cinematic --out film.png
  bokehcam render --like snapshot.png --rim 0.1 --out another.png")]
pub struct RenderCommand {
    /// The picture, PNG or JPEG [default: the one that the snapshot of --like was made of]
    #[arg(required_unless_present = "like")]
    image: Option<PathBuf>,
    /// Its depth: 16-bit grey PNG, or PFM in metres; or disparity that `depth` wrote
    #[arg(long, value_name = "FILE")]
    depth_map: Option<PathBuf>,
    /// A mask of the subject, PNG or JPEG, of any size: white is the subject, which stays sharp
    #[arg(long, value_name = "FILE", conflicts_with_all = ["depth_map", "like"])]
    mask: Option<PathBuf>,
    /// Take the settings of a snapshot of the preview; flags go before them. Without IMAGE, its NAME-color.png and, without
    /// --depth-map, its NAME-depth.pfm are blurred, which gives the same picture again
    #[arg(long, value_name = "NAME.png")]
    like: Option<PathBuf>,
    /// Where the result goes, .png or .jpg
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Write every intermediate of the blur into this folder: the CoC, each bin before and after its filters, what
    /// near objects hide, as PNG, and plan.json (CPU executor)
    #[arg(long, value_name = "DIR")]
    debug_dir: Option<PathBuf>,
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
/// A picture cannot be read or written, the options do not fit it, or the blur failed.
pub fn run(command: &RenderCommand, global: &options::Global, given: &Given) -> Result<(), CliError> {
    let plan_file = command.debug_dir.as_ref().map(|dir| dir.join(debug::PLAN));
    refuse_overwrite([command.out.as_path()].into_iter().chain(plan_file.as_deref()), command.output.force)?;
    let sources = sources(command);
    for source in &sources {
        refuse_source("--out", &command.out, source)?;
        // The files in that folder have fixed names, of which the source may have one.
        if let Some(dir) = command.debug_dir.as_ref().filter(|_| command.output.force)
            && source.parent().is_some_and(|folder| place::resolved(folder) == place::resolved(dir))
        {
            refuse_source("--debug-dir", dir, source)?;
        }
    }
    if matches!(command.blur.depth, DepthChoice::Folder(_) | DepthChoice::Device(_) | DepthChoice::Stereo) {
        let what = "--depth FOLDER, stereo or a depth camera are for `stream`: give a picture's depth with --depth-map";
        return Err(CliError::Usage(what.to_string()));
    }
    let look = look::look(&command.blur, &command.computing.quality)?;
    let (color, extras, depth) = read(command, &look)?;
    let look = source::fitting_look(&look, &command.blur.depth, depth.is_some())?;
    plausible::warn_of_lens(&look);
    plausible::warn_of_depth_scale(command.depth.depth_scale);
    command.warn(&look, &color, depth.as_ref(), given);
    let computing = command.computing.choice();
    make_folder_of(&command.out)?;
    let (result, executor) = match &command.debug_dir {
        Some(dir) => debug::blurred(color, depth, &look, &computing, (dir, command.output.force))?,
        None => pipeline::still::blur(&look, color, depth, &computing)?,
    };
    // The thumbnail in the photo's metadata would show what the blur hides.
    let mut extras = extras.without_thumbnail();
    if still::photo_format(&command.out)? == PhotoFormat::Jpeg {
        extras = extras.for_jpeg();
    }
    still::write_photo(&command.out, &result, &extras, command.output.force)?;
    if !global.quiet {
        if !extras.left_behind.is_empty() {
            log::note(&format!("not in {}: {}", command.out.display(), extras.left_behind.join(", ")));
        }
        terminal::say(&format!("{}: written ({executor})", command.out.display()));
    }
    Ok(())
}

impl RenderCommand {
    /// Warns of settings without effect, and of a focus outside the depth of the picture.
    fn warn(&self, look: &Look, color: &ColorImage, depth: Option<&Depth>, given: &Given) {
        let in_units = |file: &PathBuf| still::map_format(file).is_ok_and(|format| format == MapFormat::Png);
        let in_units = self.depth_map.as_ref().is_some_and(in_units);
        let is_inverse = self.depth_map.is_some() && self.depth.depth_unit == DepthUnit::Inverse;
        let uses_depth = look.effect.follows_depth();
        unused::warn(
            &given.settings,
            &unused::Run {
                source: From::Picture,
                depth: match depth {
                    None => DepthFrom::Nothing,
                    Some(Depth::Measured(_)) if is_inverse => DepthFrom::Relative,
                    Some(Depth::Measured(_)) if in_units => DepthFrom::Units,
                    Some(_) => DepthFrom::Metres,
                },
                uses_depth,
                effect: look.effect,
                lens: matches!(look.strength, Strength::Lens(_)),
                realtime: false,
                cpu_only: self.computing.backend == Backend::Cpu,
                compresses: false,
                window: false,
            },
        );
        match depth {
            None if self.blur.takes_whatever_depth() => unused::warn_of_no_depth(From::Picture),
            Some(_) if self.depth_map.is_some() && !uses_depth => {
                log::warn("--depth-map has no effect: the effect does not use depth");
            }
            Some(Depth::Measured(map))
                if self.depth_map.as_ref().is_some_and(|file| self.warn_of_map(file, map, color)) => {}
            Some(Depth::Measured(map) | Depth::Final(map)) => focus::warn_of_focus(look, color.size(), map, in_units),
            None => {}
        }
        if let (Some(Depth::Measured(map)), Some(file), true) = (depth, &self.depth_map, uses_depth) {
            say_of_misfit(&file.display(), look, map, color);
        }
    }
}

impl RenderCommand {
    /// Warns of a depth map that cannot be meant; whether it did.
    fn warn_of_map(&self, file: &Path, map: &DepthMap, color: &ColorImage) -> bool {
        let is_scaled = still::map_format(file).is_ok_and(|format| format == MapFormat::Pfm);
        match self.depth.depth_unit {
            DepthUnit::Inverse => plausible::warn_of_inverse(&file.display(), map, color),
            DepthUnit::Metres => {
                plausible::warn_of_map(&file.display(), map, is_scaled || self.depth.depth_scale.is_some())
            }
        }
    }
}

/// Says how a depth map does not fit its picture, and what is done about it.
fn say_of_misfit(file: &dyn Display, look: &Look, map: &DepthMap, color: &ColorImage) {
    let Some(misfit) = Misfit::of(map, color) else { return };
    if misfit.outlines == Agreement::Unrelated {
        log::warn(&format!(
            "{file}: nowhere do its outlines meet those of the picture: it may be the depth of another one, or of a camera beside \
             it that is not registered to the colours"
        ));
    } else if look.refine == Refine::Auto {
        log::note(&format!("{file}: refined, as {misfit}; --refine off takes it as it is"));
    }
}

/// All files that are read, which the outputs must not replace.
fn sources(command: &RenderCommand) -> Vec<PathBuf> {
    let of_snapshot = command.like.iter().flat_map(|like| {
        let (color, depth) = snapshot::sources(like);
        [like.clone(), color, depth]
    });
    let aperture = match &command.blur.look.0.aperture {
        Some(ApertureName::Image(file)) => Some(file),
        _ => None,
    };
    let plate = match &command.blur.depth {
        DepthChoice::OneCamera(OneCamera { plate: Some(PlateFile::At(file)), .. }) => Some(file),
        _ => None,
    };
    [&command.image, &command.depth_map, &command.mask]
        .into_iter()
        .flatten()
        .chain(plate)
        .chain(aperture)
        .cloned()
        .chain(of_snapshot)
        .collect()
}

/// Reads the picture, its metadata, and its depth if there is any. What the command does not name comes from the files
/// of the snapshot of `--like`, whose depth was refined before and is not refined again.
fn read(command: &RenderCommand, look: &Look) -> Result<(ColorImage, Extras, Option<Depth>), CliError> {
    let sources = command.like.as_ref().map(|like| snapshot::sources(like));
    let given =
        command.depth_map.as_deref().map(|file| read_depth(file, command, look)).transpose()?.map(Depth::Measured);
    let (color, extras, depth) = match (&command.image, sources) {
        (None, Some((color, depth))) => {
            let is_used = given.is_none() && depth.exists();
            let kept = is_used.then(|| read_depth(&depth, command, look)).transpose()?.map(Depth::Final);
            let (color, extras) = still::read_photo(&color)?;
            (color, extras, given.or(kept))
        }
        (image, _) => {
            // clap requires an image without `--like`.
            let (color, extras) = still::read_photo(image.as_deref().unwrap_or(Path::new("")))?;
            (color, extras, given)
        }
    };
    if let (Some(Depth::Measured(map)), Some(file)) = (&depth, &command.depth_map) {
        still::check_depth_size(file, map.size(), color.size())?;
    }
    let made = made_depth(command, look, &color)?;
    Ok((color, extras, made.or(depth)))
}

/// The depth that is made for the picture: from a mask, or by networks; `None` where nothing of that is asked for.
fn made_depth(command: &RenderCommand, look: &Look, color: &ColorImage) -> Result<Option<Depth>, CliError> {
    let is_given = command.depth_map.is_some() || command.mask.is_some();
    match (&command.mask, &command.blur.depth) {
        (_, DepthChoice::OneCamera(_) | DepthChoice::Defocus) if is_given => {
            let what = "--depth matte, mono, plate and defocus make the depth: leave --depth-map and --mask out";
            Err(CliError::Usage(what.to_string()))
        }
        (Some(file), _) => {
            source::refuse_metres(look, "a mask tells")?;
            let (width, height, share) = still::read_grey(file)?;
            still::check_mask_size(file, (width, height), color.size())?;
            let mask = Mask { width, height, share };
            plausible::warn_of_mask(file, &mask, color);
            Ok(Some(Depth::Final(mask::depth_around(&mask, color))))
        }
        (None, DepthChoice::OneCamera(chosen)) => {
            let options = source::Options { networks: command.networks.clone(), ..source::Options::default() };
            let map = source::one_camera::depth_of_picture(chosen, &options, look, color)?;
            plausible::warn_of_subject(chosen, &map, command.image.as_deref());
            // Around a subject it has its matte already; else its outlines are soft, and are fitted to the picture.
            Ok(Some(if map.subject_m.is_some() { Depth::Final(map) } else { Depth::Measured(map) }))
        }
        (None, DepthChoice::Defocus) => {
            source::refuse_metres(look, "defocus tells")?;
            defocus::depth(color).map(Depth::Final).map(Some).ok_or_else(|| {
                let what = "--depth defocus: the picture is equally sharp all over, or has hardly any edges, so that nothing can be \
                            told of its depth; --depth mono or --effect blur needs no such difference";
                CliError::Usage(what.to_string())
            })
        }
        _ => Ok(None),
    }
}

/// Reads relative inverse depth as distances in units of the nearest one.
fn read_inverse_depth(file: &Path, invert: bool) -> Result<DepthMap, CliError> {
    let (width, height, mut nearness) = match still::map_format(file) {
        Ok(MapFormat::Pfm) => match still::read_map(file, None, None)? {
            still::Map::Depth(map) => (map.width, map.height, map.metres),
            still::Map::Disparity(map, _) => (map.width, map.height, map.px),
        },
        _ => still::read_grey(file)?,
    };
    let known = nearness.iter().copied().filter(|value| value.is_finite());
    let (low, high) = known.fold((f32::MAX, f32::MIN), |(low, high), value| (low.min(value), high.max(value)));
    let scale = 1.0 / (high - low).max(f32::MIN_POSITIVE);
    for value in &mut nearness {
        let near = (*value - low) * scale;
        let near = if invert { 1.0 - near } else { near };
        *value = if near.is_finite() { DepthMap::relative_m(near) } else { 0.0 };
    }
    Ok(DepthMap { width, height, metres: nearness, ..DepthMap::default() })
}

/// Reads depth in metres from a file of depth or disparity. Disparity without stereo geometry gives depth of unknown
/// scale, which is an error where the look needs real metres.
fn read_depth(file: &Path, command: &RenderCommand, look: &Look) -> Result<DepthMap, CliError> {
    let name = file.display();
    if command.depth.depth_unit == DepthUnit::Inverse {
        source::refuse_metres(look, source::INVERSE_TELLS)?;
        return read_inverse_depth(file, command.depth.depth_invert);
    }
    let options::Depth { depth_scale, depth_invalid, .. } = command.depth;
    let (map, rig) = match still::read_map(file, depth_scale, Some(depth_invalid))? {
        still::Map::Depth(map) => return Ok(map),
        still::Map::Disparity(map, rig) => (map, rig),
    };
    if depth_scale.is_some() {
        tracing::warn!("{name}: holds disparity, to which --depth-scale does not apply");
    }
    let rig = match (rig, look.needs_metres()) {
        (Some(rig), _) => rig,
        (None, None) => {
            tracing::warn!("{name}: holds disparity without distances: what is near and far is known, and not how far");
            StereoRig::assumed(map.width)
        }
        (None, Some(needs)) => {
            return Err(CliError::Usage(format!(
                "{needs} needs distances, and {name} holds disparity without any: write it with `depth --metres`; --focus \
                 auto or X,Y and --coc-at-infinity need none"
            )));
        }
    };
    Ok(map.depth(|px| rig.depth_m(px)))
}
