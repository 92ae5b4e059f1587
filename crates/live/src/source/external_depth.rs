//! External depth for a source, from another recording or a depth camera.

use std::path::Path;

use super::opened::recorded_depth_origin;
use super::orientation::SourceTransform;
use super::{
    DepthChoice, DepthOrigin, Frames, OpenRequest, Options, Source, SourceError, SourceName, cameras, registration,
    single_camera, video,
};
use crate::capture::{CaptureError, FrameData};
use crate::depth::looped_recording::LoopedRecording;
use crate::depth::map_sequence::SequenceDepth;
use bokehcam::clock::Clock;
use bokehcam::depth::DepthSource;
use bokehcam_media::recording::map_sequence::{MapSequence, Pictured};
use bokehcam_video::VideoFile;

/// Adds the depth that `--depth` names to `source`, if it is external; otherwise returns the source unchanged. The
/// source is transformed already.
///
/// # Errors
/// The depth cannot be opened, or an option does not apply to it.
pub(super) fn add_external_depth(
    source: Source,
    (name, transform): (&SourceName, &SourceTransform),
    request: &OpenRequest,
    clock: &Clock,
) -> Result<Source, SourceError> {
    let Options { depth, depth_choice: choice, .. } = request.options;
    if !choice.is_external() {
        return Ok(source);
    }
    if !request.uses_depth() {
        return SourceError::usage_error("only --effect dof uses depth: leave --depth or --effect out");
    }
    if source.camera.info().frame_data == FrameData::Depth {
        return SourceError::usage_error("the source has its own depth: leave --depth out");
    }
    if let Some(folder) = choice.map_folder() {
        return add_map_sequence(source, folder, (name, transform), request);
    }
    let mut first_depth = None;
    let (external, depth_from): (Box<dyn DepthSource>, _) = match choice {
        DepthChoice::Auto | DepthChoice::Recorded | DepthChoice::Stereo | DepthChoice::None => return Ok(source),
        DepthChoice::Folder(folder) => {
            let recording = registration::open_recording(folder, true, request.options)?;
            let depth_from = recorded_depth_origin(&recording);
            first_depth = request.read_first_depth(&recording);
            (Box::new(LoopedRecording::new(recording, &folder.display().to_string())?), depth_from)
        }
        DepthChoice::Video(file) => {
            (Box::new(video::open_depth(file, transform.own_px, name, depth)?), DepthOrigin::Relative)
        }
        DepthChoice::Device(name) => (cameras::open_depth_camera(name, depth, clock)?, DepthOrigin::Units),
        DepthChoice::SingleCamera(chosen) => return single_camera::add_depth(source, chosen, name, request),
        DepthChoice::Defocus => {
            return SourceError::usage_error(
                "--depth defocus is for a photograph: bokehcam render PHOTO --depth defocus",
            );
        }
    };
    // Such depth is of the camera's own pictures.
    let first_depth = first_depth.map(|map| transform.apply_to_map(map));
    Ok(Source { depth: Some(transform.apply_to_depth(external)), depth_from, first_depth, ..source })
}

/// Adds the depth maps in `folder`, one for each frame.
///
/// # Errors
/// The source is no video or folder of pictures, has another number of frames, or no map can be read.
fn add_map_sequence(
    mut source: Source,
    folder: &Path,
    (name, transform): (&SourceName, &SourceTransform),
    request: &OpenRequest,
) -> Result<Source, SourceError> {
    let pictured = match name {
        SourceName::Video(path) => Pictured::Frames(VideoFile::open(path).map_err(CaptureError::from)?.frames),
        SourceName::Folder(_) => Pictured::Files(&source.findings.picture_stems),
        SourceName::Stdin => Pictured::Frames(None),
        _ => {
            return SourceError::usage_error(format!(
                "--depth {}: depth maps, one for each frame, belong to a video or a folder of pictures, and {name} is \
                 neither",
                folder.display()
            ));
        }
    };
    let played = last_played_frame(&request.options.frames, source.camera.info().period_ns);
    let (maps, notes) = MapSequence::open(folder, pictured, played, request.options.depth.of_photo())?;
    let depth_from = DepthOrigin::from(maps.distances());
    source.findings.notes.extend(notes);
    // The maps are of the source's own pictures.
    let size = transform.own_px;
    let registration =
        if depth_from.is_relative() { None } else { registration::open(&request.options.depth, Some(size))? };
    let first_depth = maps.read(0, size).ok().map(|file| transform.apply_to_map(file.map));
    let depth = transform.apply_to_depth(Box::new(SequenceDepth::new(maps, registration, size)));
    Ok(Source { depth: Some(depth), depth_from, first_depth, ..source })
}

/// Returns the number of frames up to the last one that is played, of a source with a frame every `period_ns`; `None` if
/// all are.
fn last_played_frame(frames: &Frames, period_ns: u64) -> Option<u64> {
    // Of frames with uneven times, there may be more: each that lacks a map says so.
    let before = |seconds: f64| (seconds * 1e9 / period_ns as f64).ceil() as u64;
    let by_count = frames.frames.map(|count| before(frames.start.unwrap_or(0.0)).saturating_add(count));
    [by_count, frames.end.map(before)].into_iter().flatten().min()
}
