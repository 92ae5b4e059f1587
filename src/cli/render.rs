//! `render`: one still picture.

use std::path::{Path, PathBuf};

use clap::Args;

use super::config::{self, Executor};
use super::error::CliError;
use super::files::{refuse_overwrite, refuse_source};
use super::{debug, options, terminal};
use crate::bokeh::{BokehError, Job};
use crate::compute::Place;
use crate::depth::{fill::Filler, focus::Focus, refine::Refiner};
use crate::files::place;
use crate::frame::{ColorImage, DepthMap};
use crate::link::pool::Pooled;
use crate::look::{ApertureName, Look};
use crate::optics::CocField;
use crate::pipeline::CocRule;
use crate::recording::{snapshot, still};

/// Blur one still picture
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  bokehcam render photo.jpg --depth-map depth.png --out portrait.png
  bokehcam render photo.jpg --depth-map depth.pfm --focus 0.5,0.4 --aperture polygon:6 --out portrait.png
  bokehcam render photo.jpg --effect tilt-shift --tilt 0.6:0.1:10 --out small-world.png
  bokehcam render photo.jpg --effect blur --coc-at-infinity 12 --aperture heart --out hearts.png
  bokehcam render photo.jpg --depth-map depth.png --out portrait.png --debug-dir within/
  bokehcam render photo.jpg --depth-map depth.png --preset cinematic --out film.png
  bokehcam render --like snapshot.png --rim 0.1 --out another.png")]
pub struct RenderCommand {
    /// The picture, PNG or JPEG [default: the one that the snapshot of --like was made of]
    #[arg(required_unless_present = "like")]
    image: Option<PathBuf>,
    /// Its depth: 16-bit grey PNG, or PFM in metres
    #[arg(long, value_name = "FILE")]
    depth_map: Option<PathBuf>,
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
    aperture: options::Aperture,
    #[command(flatten)]
    computing: options::Computing,
    #[command(flatten)]
    output: options::Output,
}

/// Runs the command.
///
/// # Errors
/// A picture cannot be read or written, the options do not fit it, or the blur failed.
pub fn run(command: &RenderCommand, global: &options::Global) -> Result<(), CliError> {
    let plan_file = command.debug_dir.as_ref().map(|dir| dir.join(debug::PLAN));
    refuse_overwrite([command.out.as_path()].into_iter().chain(plan_file.as_deref()), command.output.force)?;
    let sources = sources(command);
    for source in &sources {
        refuse_source("--out", &command.out, source)?;
        // Its files are called as they must be.
        if let Some(dir) = command.debug_dir.as_ref().filter(|_| command.output.force)
            && source.parent().is_some_and(|folder| place::resolved(folder) == place::resolved(dir))
        {
            refuse_source("--debug-dir", dir, source)?;
        }
    }
    if command.blur.depth.is_elsewhere() {
        let what = "--depth FOLDER or a depth camera are for `stream`: give a picture's depth with --depth-map";
        return Err(CliError::Usage(what.to_string()));
    }
    let (color, depth) = read(command)?;
    let look = config::look(&command.blur, &command.aperture, command.computing.quality, depth.is_some())?;
    let executor = Executor::of(&command.computing);
    let (result, by) = match &command.debug_dir {
        Some(dir) => debug::blurred(color, depth, &look, &executor, (dir, command.output.force))?,
        None => blurred(color, depth, &look, &executor)?,
    };
    still::write_color(&command.out, &result, command.output.force)?;
    if !global.quiet {
        terminal::say(&format!("{}: written ({by})", command.out.display()));
    }
    Ok(())
}

/// The pictures that are read.
fn sources(command: &RenderCommand) -> Vec<PathBuf> {
    let beside = command.like.iter().flat_map(|like| {
        let (color, depth) = snapshot::sources(like);
        [like.clone(), color, depth]
    });
    let aperture = match &command.aperture.aperture {
        ApertureName::Image(file) => Some(file),
        _ => None,
    };
    [&command.image, &command.depth_map].into_iter().flatten().chain(aperture).cloned().chain(beside).collect()
}

/// A depth map for one picture.
pub enum Depth {
    /// As it was measured: with holes, and noise.
    Measured(DepthMap),
    /// As a blur had it.
    Final(DepthMap),
}

/// The picture, and its depth if there is any.
fn read(command: &RenderCommand) -> Result<(ColorImage, Option<Depth>), CliError> {
    let sources = command.like.as_ref().map(|like| snapshot::sources(like));
    let read_depth =
        |file: &Path| still::read_depth(file, command.depth.file_scale(), Some(command.depth.depth_invalid));
    let given = command.depth_map.as_deref().map(read_depth).transpose()?.map(Depth::Measured);
    match (&command.image, sources) {
        (None, Some((color, depth))) => {
            let kept = given.is_none() && depth.exists();
            let kept = kept.then(|| read_depth(&depth)).transpose()?.map(Depth::Final);
            Ok((still::read_color(&color)?, given.or(kept)))
        }
        (image, _) => Ok((still::read_color(image.as_deref().unwrap_or(Path::new("")))?, given)),
    }
}

/// The blurred picture, and what blurred it.
fn blurred(
    color: ColorImage,
    depth: Option<Depth>,
    look: &Look,
    executor: &Executor,
) -> Result<(ColorImage, String), CliError> {
    let size = color.size();
    let Some(settings) = look.settings(size, false) else { return Ok((color, "not blurred".to_string())) };
    let (coc, depth) = prepared(look, &color, depth)?;
    let mut bokeh = executor.create(&settings, size)?;
    bokeh.submit(Job {
        ticket: 0,
        color: Pooled::detached(color),
        depth: depth.map(Pooled::detached),
        coc,
        quality: settings.quality,
        place: Place::Memory,
        out: Pooled::detached(ColorImage::default()),
    })?;
    match bokeh.collect(true)? {
        Some(mut finished) => Ok((std::mem::take(&mut *finished.out), bokeh.describe())),
        None => Err(CliError::NothingCameBack),
    }
}

/// What a frame on its own is blurred by: the radius of every pixel, and the depth map (if it was measured, with holes
/// filled, and refined if that was asked for) if that needs it.
///
/// # Errors
/// [`BokehError::NoDepth`] when the blur follows depth and there is none.
pub fn prepared(
    look: &Look,
    color: &ColorImage,
    depth: Option<Depth>,
) -> Result<(CocField, Option<DepthMap>), BokehError> {
    match (look.coc_rule(color.size()), depth) {
        (CocRule::Fixed(field), _) => Ok((field, None)),
        (CocRule::Depth { .. }, None) => Err(BokehError::NoDepth),
        (CocRule::Depth { focus, lens, range_m, max_coc_px }, Some(depth)) => {
            let (mut map, measured) = match depth {
                Depth::Measured(map) => (map, true),
                Depth::Final(map) => (map, false),
            };
            // Focus looks at what was measured, so it comes before the holes are filled.
            let focus_m = Focus::new(focus).focus_m(&map, 0);
            if measured && look.refines(false) {
                let mut refiner = Refiner::new();
                refiner.focus_at(focus_m);
                refiner.refine(&mut map, color, 0);
            } else if measured {
                Filler::new().fill_by(&mut map, color);
            }
            Ok((lens.field((focus_m, range_m), color.width, max_coc_px), Some(map)))
        }
    }
}
