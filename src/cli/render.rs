//! `render`: one still picture.

use std::path::PathBuf;

use clap::Args;

use super::config::{self, Executor};
use super::error::CliError;
use super::files::refuse_overwrite;
use super::{debug, options, terminal};
use crate::bokeh::{BokehError, Job};
use crate::depth::{fill::Filler, focus::Focus, refine::Refiner};
use crate::frame::{ColorImage, DepthMap};
use crate::link::pool::Pooled;
use crate::look::Look;
use crate::optics::CocField;
use crate::pipeline::CocRule;
use crate::recording::still;

/// Blur one still picture
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  bokehcam render photo.jpg --depth-map depth.png --out portrait.png
  bokehcam render photo.jpg --depth-map depth.pfm --focus 0.5,0.4 --aperture polygon:6 --out portrait.png
  bokehcam render photo.jpg --effect tilt-shift --tilt 0.6:0.1:10 --out small-world.png
  bokehcam render photo.jpg --effect blur --coc-at-infinity 12 --aperture heart --out hearts.png
  bokehcam render photo.jpg --depth-map depth.png --out portrait.png --debug-dir within/")]
pub struct RenderCommand {
    /// The picture, PNG or JPEG
    image: PathBuf,
    /// Its depth: 16-bit grey PNG, or PFM in metres
    #[arg(long, value_name = "FILE")]
    depth_map: Option<PathBuf>,
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
    if command.blur.depth.is_elsewhere() {
        let what = "--depth FOLDER or a depth camera are for `stream`: give a picture's depth with --depth-map";
        return Err(CliError::Usage(what.to_string()));
    }
    let color = still::read_color(&command.image)?;
    let read_depth =
        |file: &PathBuf| still::read_depth(file, command.depth.file_scale(), Some(command.depth.depth_invalid));
    let depth = command.depth_map.as_ref().map(read_depth).transpose()?;
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

/// The blurred picture, and what blurred it.
fn blurred(
    color: ColorImage,
    depth: Option<DepthMap>,
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
        out: Pooled::detached(ColorImage::default()),
    })?;
    match bokeh.collect(true)? {
        Some(mut finished) => Ok((std::mem::take(&mut *finished.out), bokeh.describe())),
        None => Err(CliError::NothingCameBack),
    }
}

/// What a frame on its own is blurred by: the radius of every pixel, and the depth map (holes filled, and
/// refined if that was asked for) if that needs it.
///
/// # Errors
/// [`BokehError::NoDepth`] when the blur follows depth and there is none.
pub fn prepared(
    look: &Look,
    color: &ColorImage,
    depth: Option<DepthMap>,
) -> Result<(CocField, Option<DepthMap>), BokehError> {
    match (look.coc_rule(color.size()), depth) {
        (CocRule::Fixed(field), _) => Ok((field, None)),
        (CocRule::Depth { .. }, None) => Err(BokehError::NoDepth),
        (CocRule::Depth { focus, lens, range_m, max_coc_px }, Some(mut map)) => {
            // Focus looks at what was measured, so it comes before the holes are filled.
            let focus_m = Focus::new(focus).focus_m(&map, 0);
            match look.refines(false) {
                true => {
                    let mut refiner = Refiner::new();
                    refiner.focus_at(focus_m);
                    refiner.refine(&mut map, color, 0);
                }
                false => Filler::new().fill_by(&mut map, color),
            }
            Ok((lens.field((focus_m, range_m), color.width, max_coc_px), Some(map)))
        }
    }
}
