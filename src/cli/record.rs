//! `record`: a source as a recording.

use std::path::PathBuf;
use std::sync::atomic::Ordering;

use clap::Args;

use super::config::Executor;
use super::error::CliError;
use super::layers::Given;
use super::source::{Source, SourceName, Wanted};
use super::{options, terminal, unused, values};
use crate::capture::{Brings, Captured, Shot};
use crate::depth::Seen;
use crate::frame::{ColorImage, DepthMap, GrayImage};
use crate::recording::tum::{Writer, WriterOptions};

/// Record a source in the TUM RGB-D layout
///
/// Writes rgb/, depth/ (16-bit PNG, 5000 units per metre, 0 unknown; of two eyes, matched) and their lists. The lists appear when the
/// recording is whole; Ctrl-C ends it whole.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  bokehcam record /dev/video0 --size 640x480 --frames 300 --to recordings/me
  bokehcam record synthetic --frames 90 --size 320x240 --to recordings/mine
  bokehcam record somewhere/rgbd --depth-scale 1000 --start 2 --end 5 --to excerpt")]
pub struct RecordCommand {
    /// A camera, two cameras LEFT,RIGHT, a folder with a recording, or `synthetic`
    #[arg(value_parser = SourceName::parser())]
    source: SourceName,
    /// Folder for the recording
    #[arg(long, value_name = "DIR")]
    to: PathBuf,
    #[command(flatten)]
    frames: options::Source,
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
/// The source cannot be read, or the recording exists (without `--force`) or cannot be written.
pub fn run(command: &RecordCommand, global: &options::Global, given: &Given) -> Result<(), CliError> {
    let wanted = Wanted {
        frames: &command.frames,
        depth: &command.depth,
        stereo: &command.stereo,
        blur: None,
        executor: &Executor::new(values::Backend::Auto, None, None),
        cycle: false,
        keep_going: false,
    };
    let Source { mut camera, depth: mut source, rig, depth_from, .. } = Source::open(&command.source, &wanted)?;
    unused::warn(
        &given.settings,
        &unused::Run {
            source: command.source.kind(),
            depth: depth_from,
            uses_depth: true,
            effect: None,
            lens: false,
            realtime: true,
            cpu_only: false,
            window: false,
        },
    );
    if rig.is_some_and(|rig| !rig.metric) {
        tracing::warn!("the distance of the two eyes is not known: the metres of this depth are those of assumed eyes");
    }
    let info = camera.info();
    let options = WriterOptions { overwrite: command.output.force, ..WriterOptions::default() };
    let mut writer = Writer::create(&command.to, &options)?;
    let stop = terminal::stop_flag()?;
    let progress = terminal::Progress::new(info.frames, global);
    let (mut color, mut depth, mut right) = (ColorImage::default(), DepthMap::default(), GrayImage::default());
    let (mut recorded, mut lost) = (0, 0);
    while !stop.load(Ordering::Relaxed) {
        let stamp = match camera.next(Shot { color: &mut color, depth: &mut depth, right: &mut right })? {
            Captured::Frame(stamp) => stamp,
            Captured::Corrupt(error) => return Err(error.into()),
            Captured::Lost(count, _) => {
                lost += count;
                continue;
            }
            Captured::Waiting => continue,
            Captured::End => break,
        };
        if let Some(source) = &mut source {
            source.straighten(&mut color);
            let right = (info.brings == Brings::RightEye).then_some(&right);
            source.read(Seen { stamp, color: &color, right }, &mut depth)?;
        }
        let has_depth = source.is_some() || info.brings == Brings::Depth;
        writer.add(stamp.time_ns, &color, has_depth.then_some(&depth))?;
        recorded += 1;
        progress.delivered(recorded);
    }
    writer.finish()?;
    drop(progress);
    if lost > 0 {
        tracing::warn!("{lost} frames came and went before they could be written");
    }
    if !global.quiet {
        terminal::say(&format!("{}: {recorded} frames recorded from {}", command.to.display(), info.name));
    }
    Ok(())
}
