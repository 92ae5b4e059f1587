//! `plate`: takes a picture of the background (the plate) for `--depth plate:FILE`.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::Args;

use crate::error::CliError;
use crate::files::{
    check_picture_name, create_parent_folder, refuse_overwrite, refuse_overwriting_source, warn_of_leftovers,
};
use crate::log;
use crate::options;
use crate::settings::layers::GivenSettings;
use crate::settings::unused;
use crate::terminal::{self, Guidance};
use bokehcam::depth::plate::{Capture, CaptureResult, Step};
use bokehcam::depth::{DepthSource, FrameInput};
use bokehcam::frame::{ColorImage, DepthMap, GrayImage, Stamp};
use bokehcam::look::{Effect, Look};
use bokehcam_live::capture::{Camera, FrameBuffers};
use bokehcam_live::source::{DepthChoice, Kind, Options, Source, SourceName, single_camera};
use bokehcam_media::recording::still;

/// Take a plate: a picture of the background without you, for --depth plate:FILE
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  bokehcam plate /dev/video0 --to room.png
  bokehcam stream /dev/video0 --depth plate:room.png --to /dev/video10
  bokehcam plate somewhere/empty-room --to room.png

Step out of the picture for about four seconds when the program says so. The camera must not move from then on. In the
plate of a recording, each pixel is its median over time.")]
pub struct PlateCommand {
    /// A camera, or a recording (a folder, .mcap, .r3d or Kinect's .mkv)
    #[arg(value_parser = options::source_name_parser())]
    source: SourceName,
    /// File for the plate, .png or .jpg
    #[arg(long, alias = "out", value_name = "FILE")]
    to: PathBuf,
    #[command(flatten)]
    frames: options::Frames,
    #[command(flatten)]
    output: options::Output,
}

/// Runs the command.
///
/// # Errors
/// Fails if the source is unreadable, the picture never stands still, or the plate exists (without `--force`) or cannot
/// be written.
pub fn run(command: &PlateCommand, global: &options::Global, given: &GivenSettings) -> Result<(), CliError> {
    let PlateCommand { source: name, to, frames, output } = command;
    refuse_overwrite([to.as_path()], output.force)?;
    for folder in name.input_paths() {
        refuse_overwriting_source("--to", to, &folder)?;
    }
    check_picture_name("--to", to)?;
    let options = Options { frames: frames.clone(), depth_choice: DepthChoice::None, ..Options::default() };
    let Source { camera, depth_from, .. } = Source::open(name, &options, None)?;
    unused::warn_of_unused(
        &given.settings,
        &unused::RunFacts { realtime: camera.info().live, ..unused::RunFacts::default() }.for_look(
            unused::FrameOrigin::Source(name.kind()),
            depth_from,
            &Look::with_effect(Effect::None),
        ),
    );
    // Ctrl-C ends the reading, not the program: a recording's plate so far is still written.
    let stop = terminal::stop_flag()?;
    let mut frames = Frames { camera, stop, color: ColorImage::default() };
    let plate = match frames.camera.info().live {
        true => plate_from_camera(&mut frames, name, global)?,
        false => plate_from_recording(&mut frames)?,
    };
    if name.kind() == Kind::Photo {
        log::warn("a photo is a single picture: a person in it becomes part of the plate, and is not found");
    }
    create_parent_folder(to)?;
    warn_of_leftovers([to.as_path()]);
    still::write_color(to, &plate, output.force)?;
    if !global.quiet {
        terminal::print_to_stderr(&format!("{}: written, for --depth plate:{0}", to.display()));
    }
    Ok(())
}

/// Reads the colour frames of a source in order.
struct Frames {
    camera: Box<dyn Camera>,
    stop: Arc<AtomicBool>,
    color: ColorImage,
}

impl Frames {
    /// Reads the next frame; returns `None` at the end, or when the user stops.
    fn next(&mut self) -> Result<Option<Stamp>, CliError> {
        let (mut depth, mut right) = (DepthMap::default(), GrayImage::default());
        let buffers = FrameBuffers { color: &mut self.color, depth: &mut depth, right: &mut right };
        Ok(self.camera.wait_for_frame(buffers, &self.stop, &mut 0)?)
    }
}

/// Takes the plate from a camera, with a countdown for the user.
fn plate_from_camera(frames: &mut Frames, name: &SourceName, global: &options::Global) -> Result<ColorImage, CliError> {
    let (mut source, guide) = single_camera::create_plate_source(name);
    let guidance = Guidance::new(Some(guide), global);
    let mut map = DepthMap::default();
    while let Some(stamp) = frames.next()? {
        source.read(FrameInput { stamp, color: &frames.color, right: None }, &mut map)?;
        guidance.print_step();
        match (source.plate(), guidance.step()) {
            (Some(plate), _) => return Ok(plate.clone()),
            (None, Some(step @ Step::KeepsMoving)) => return Err(CliError::NoPlate(step.to_string())),
            (None, _) => {}
        }
    }
    Err(CliError::NoPlate("the source ended before the plate was taken".to_owned()))
}

/// Returns the plate of a recording: the per-pixel median of frames spread evenly over it.
fn plate_from_recording(frames: &mut Frames) -> Result<ColorImage, CliError> {
    let count = frames.camera.info().frames.unwrap_or(1);
    let every = (count / Capture::PICTURES as u64).max(1);
    let (mut capture, mut index) = (Capture::default(), 0);
    while frames.next()?.is_some() {
        if index % every == 0
            && let CaptureResult::Finished(plate) = capture.add_unchecked(&frames.color)
        {
            return Ok(plate);
        }
        index += 1;
    }
    match index {
        0 => Err(CliError::NoPlate("there is no frame".to_owned())),
        _ => Ok(capture.finish()),
    }
}
