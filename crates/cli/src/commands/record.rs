//! `record`: writes a source as a recording.

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use clap::Args;

use crate::error::CliError;
use crate::files::refuse_overwriting_source;
use crate::log;
use crate::options;
use crate::settings::layers::GivenSettings;
use crate::settings::unused;
use crate::terminal;
use bokehcam::depth::FrameInput;
use bokehcam::frame::{ColorImage, DepthMap, GrayImage};
use bokehcam::look::{Effect, Look};
use bokehcam_live::capture::{FrameBuffers, FrameData};
use bokehcam_live::source::{Options, Source, SourceName};
use bokehcam_media::recording::{RecordingSummary, RecordingWriter};

/// Record a source in the TUM RGB-D layout, or as an MCAP file of ROS 2
///
/// Writes rgb/, depth/ (16-bit PNG, 5000 units per metre, 0 unknown; for two cameras, by stereo matching) and their
/// lists. The lists appear when the recording is complete; Ctrl-C completes a recording of a camera. With --force, a
/// complete recording replaces the folder of an earlier one, if it has no other files; an incomplete one is kept beside
/// it as DIR.incomplete. A name ending in .mcap is a file instead: colour as CompressedImage (PNG), depth
/// as compressedDepth (millimetres), each with an uncalibrated CameraInfo.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  bokehcam record /dev/video0 --size 640x480 --frames 300 --to recordings/me
  bokehcam record synthetic --frames 90 --size 320x240 --to recordings/mine
  bokehcam record somewhere/rgbd --depth-scale 1000 --start 2 --end 5 --to excerpt
  bokehcam record somewhere/take.r3d --to take.mcap")]
pub struct RecordCommand {
    /// A camera, two cameras LEFT,RIGHT, a recording (a folder, .mcap, .r3d or Kinect's .mkv), a video, - (y4m on
    /// standard input), `demo` or `synthetic`
    #[arg(value_parser = options::source_name_parser())]
    source: SourceName,
    /// Folder for the recording, or an MCAP file
    #[arg(long, alias = "out", value_name = "DIR|FILE.mcap")]
    to: PathBuf,
    #[command(flatten)]
    frames: options::Frames,
    #[command(flatten)]
    depth: options::Depth,
    #[command(flatten)]
    stereo: options::Stereo,
    #[command(flatten)]
    output: options::Output,
}

/// Runs the command.
///
/// # Errors
/// Fails if the source is unreadable, or the recording exists (without `--force`) or cannot be written.
pub fn run(command: &RecordCommand, global: &options::Global, given: &GivenSettings) -> Result<(), CliError> {
    let ending = command.to.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    if ["mp4", "mkv", "webm", "mov", "avi", "y4m"].contains(&ending) && !command.to.is_dir() {
        let to = command.to.display();
        return Err(CliError::Usage(format!(
            "--to {to}: a recording is a folder of pictures or a .mcap file; a video is made by `bokehcam stream {} --effect none --to FILE.mp4`",
            command.source
        )));
    }
    for folder in command.source.input_paths() {
        refuse_overwriting_source("--to", &command.to, &folder)?;
    }
    let mut source = open_source(command, given)?;
    let mut writer = RecordingWriter::create(&command.to, command.output.force)?;
    let mut lost = 0;
    // On errors and panics, the frames recorded so far are kept below.
    let outcome = CliError::catch_panic(|| record_frames(&mut source, &mut writer, &mut lost, global));
    if lost > 0 {
        tracing::warn!("{lost} frames were lost because writing was too slow");
    }
    match outcome {
        Ok(true) => {
            let max_depth_m = writer.max_depth_m();
            let written = writer.finish()?;
            warn_out_of_range_depth(&written, max_depth_m);
            if !global.quiet {
                let gone = match written.replaced {
                    0 => String::new(),
                    1 => ", in place of an earlier one".to_owned(),
                    files => format!(", in place of {files} files of an earlier recording"),
                };
                let (dir, frames) = (written.dir.display(), written.frames);
                terminal::print_to_stderr(&format!(
                    "{dir}: {frames} frames recorded from {}{gone}",
                    source.camera.info().name
                ));
            }
            Ok(())
        }
        Ok(false) => keep_partial(writer, &command.to),
        Err(fault) => {
            if writer.frames() > 0
                && let Err(error) = keep_partial(writer, &command.to)
            {
                tracing::warn!("{error}");
            }
            Err(fault)
        }
    }
}

/// Opens the source, prints what was assumed about it, and warns of settings without effect on it and of distances that are
/// no metres.
fn open_source(command: &RecordCommand, given: &GivenSettings) -> Result<Source, CliError> {
    let options = Options {
        frames: command.frames.clone(),
        depth: command.depth.clone(),
        stereo: command.stereo.clone(),
        ..Options::default()
    };
    let source = Source::open(&command.source, &options, None)?;
    unused::warn_of_unused(
        &given.settings,
        &unused::RunFacts { realtime: true, ..unused::RunFacts::default() }.for_look(
            unused::FrameOrigin::Source(command.source.kind()),
            source.depth_from,
            &Look::with_effect(Effect::Dof),
        ),
    );
    if source.rig.is_some_and(|rig| !rig.metric) {
        tracing::warn!(
            "the distance between the two cameras is not known: the metres of this depth are based on an assumed one"
        );
    }
    source.findings.notes.iter().for_each(|note| log::note(note));
    if source.depth_from.is_relative() {
        tracing::warn!(
            "this depth is relative: the metres of the recording tell only the order of distances; if depth pictures \
             hold distances, add --depth-unit metres; else focus the recording by a point, such as --focus 0.5,0.4"
        );
    }
    Ok(source)
}

/// Writes all frames of the source; returns whether it ended by itself or, for a camera, was stopped. Counts those `lost`.
fn record_frames(
    Source { camera, depth: source, .. }: &mut Source,
    writer: &mut RecordingWriter,
    lost: &mut u64,
    global: &options::Global,
) -> Result<bool, CliError> {
    let info = camera.info();
    let stop = terminal::stop_flag()?;
    let progress = terminal::Progress::new(info.frames, global);
    let (mut color, mut depth, mut right) = (ColorImage::default(), DepthMap::default(), GrayImage::default());
    loop {
        let buffers = FrameBuffers { color: &mut color, depth: &mut depth, right: &mut right };
        let Some(stamp) = camera.wait_for_frame(buffers, &stop, lost)? else { break };
        if let Some(source) = source {
            source.rectify(&mut color);
            let right = (info.frame_data == FrameData::RightCamera).then_some(&right);
            source.read(FrameInput { stamp, color: &color, right }, &mut depth)?;
        }
        let has_depth = source.is_some() || info.frame_data == FrameData::Depth;
        writer.add(stamp.time_ns, &color, has_depth.then_some(&depth))?;
        let recorded = writer.frames() as u64;
        progress.set_delivered(recorded);
        if info.is_complete(recorded) {
            break;
        }
    }
    // A camera is endless: stopping it is its regular end.
    Ok(!stop.load(Ordering::Relaxed) || info.live || info.frames.is_none())
}

/// Keeps the frames of an interrupted recording, and reports where.
fn keep_partial(writer: RecordingWriter, to: &Path) -> Result<(), CliError> {
    let written = writer.finish_incomplete()?;
    let (frames, old, kept) = (written.frames, to.display(), written.dir.display());
    if written.dir == to {
        tracing::warn!("{old}: incomplete; the {frames} frames until then can be read");
    } else if !to.exists() {
        tracing::warn!("{old}: incomplete; the {frames} frames until then are in {kept}");
    } else {
        tracing::warn!("{old}: unchanged; the new recording is incomplete, and its {frames} frames are in {kept}");
    }
    Ok(())
}

/// Warns about depth beyond the recording's range.
fn warn_out_of_range_depth(written: &RecordingSummary, max_depth_m: f32) {
    if written.out_of_range_depths > 0 {
        let percent = 100.0 * written.out_of_range_depths as f64 / written.known_depths as f64;
        tracing::warn!(
            "{percent:.1} % of the depth lies beyond {max_depth_m:.1} m, more than a recording holds: it is stored as \
             unknown; is --depth-scale (units per metre) right for this source?"
        );
    }
}
