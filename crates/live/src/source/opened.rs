//! Opens a camera, recording or scene by name, with its recorded depth.

use std::path::Path;
use std::sync::Arc;

use super::{
    DepthChoice, DepthOrigin, Findings, Frames, OpenRequest, Options, Size, SourceError, SourceName, cameras, photo,
    pipewire_cameras, registration, video,
};
use crate::capture::Camera;
use crate::capture::demo::Demo;
use crate::capture::photo::Photo;
use crate::capture::replay::Replay;
use crate::capture::synthetic::{self, Format};
use crate::capture::y4m::Y4m;
use crate::depth::recorded::RecordedDepth;
use bokehcam::compute::thread_pool::core_count;
use bokehcam::depth::DepthSource;
use bokehcam::depth::constant::ConstantDepth;
use bokehcam::depth::misalignment::Misalignment;
use bokehcam::frame::DepthMap;
use bokehcam_media::recording::depth_file::describe_stretch;
use bokehcam_media::recording::{Recording, StereoGeometry};

/// Picture size of the synthetic scene.
const SYNTHETIC_SIZE: (u32, u32) = (640, 480);
/// Frame rate of the synthetic scene.
const SYNTHETIC_FPS: f64 = 30.0;

/// An opened source before stereo matching is set up.
pub(super) struct Opened {
    pub camera: Box<dyn Camera>,
    pub depth: Option<Box<dyn DepthSource>>,
    pub depth_from: DepthOrigin,
    pub first_depth: Option<DepthMap>,
    /// What the files say besides.
    pub findings: Findings,
    /// The stereo geometry that the source states.
    pub pair: StereoGeometry,
    /// The number of disparities, if a recording states it.
    pub disparities: Option<u32>,
}

impl Opened {
    /// Opens the source; right pictures are read only if stereo matching will use them.
    pub fn open(name: &SourceName, request: &OpenRequest) -> Result<Self, SourceError> {
        let Options { frames, depth_choice, .. } = request.options;
        Ok(Self::without_depth(match name {
            SourceName::Folder(folder) => return Self::open_recording(folder, request),
            SourceName::Photo(path) => return Self::open_photo(path, request),
            SourceName::Synthetic => {
                let size = frames.size.map_or(SYNTHETIC_SIZE, |size| (size.width, size.height));
                let fps = frames.fps.unwrap_or(SYNTHETIC_FPS);
                synthetic::open_camera(Format { size, fps, frames: frames.frames, threads: core_count() })?
            }
            SourceName::Demo => Box::new(Demo::new(frames.frames)?),
            SourceName::Stdin => Box::new(Y4m::stdin(frames.frames)?),
            // A seek would lose count of the frames.
            SourceName::Video(path) => Box::new(video::open(path, frames, depth_choice.counts_frames())?),
            SourceName::Camera(camera) => cameras::open(camera, frames)?,
            SourceName::Cameras(pair) => cameras::open_pair(pair, frames)?,
            SourceName::PipeWire(name) => pipewire_cameras::open(name, request.options.filters, frames)?,
        }))
    }

    fn without_depth(camera: Box<dyn Camera>) -> Self {
        Self {
            camera,
            depth: None,
            depth_from: DepthOrigin::Nothing,
            first_depth: None,
            findings: Findings::default(),
            pair: StereoGeometry::Uncalibrated,
            disparities: None,
        }
    }

    fn open_recording(folder: &Path, request: &OpenRequest) -> Result<Self, SourceError> {
        let Options { frames, depth_choice, .. } = request.options;
        let is_depth_used = matches!(depth_choice, DepthChoice::Auto | DepthChoice::Recorded);
        let recording = Arc::new(registration::open_recording(folder, is_depth_used, request.options)?);
        let name = folder.display().to_string();
        warn_of_own_properties(&recording, frames);
        let mut camera = Replay::new(Arc::clone(&recording), &name, &video::play_range(frames))?;
        let pair = recording.stereo_geometry().cloned();
        if pair.is_some() && request.uses_stereo(recording.has_depth()) {
            camera = camera.with_right_camera();
        }
        let disparities = recording.disparity_count();
        let depth_from = recorded_depth_origin(&recording);
        let first_depth = request.read_first_depth(&recording);
        let stretch = first_depth.as_ref().and_then(|map| describe_stretch(map.size(), recording.size()));
        let notes = stretch.map(|stretch| format!("the depth of {name} has {stretch}")).into_iter().collect();
        let picture_stems = recording.picture_stems();
        let depth = match recording.has_depth() {
            true => Some(Box::new(RecordedDepth::new(recording, &name)?) as Box<dyn DepthSource>),
            false => None,
        };
        Ok(Self {
            depth,
            depth_from,
            first_depth,
            findings: Findings { notes, picture_stems, ..Findings::default() },
            pair: pair.unwrap_or(StereoGeometry::Uncalibrated),
            disparities,
            ..Self::without_depth(Box::new(camera))
        })
    }

    fn open_photo(path: &Path, request: &OpenRequest) -> Result<Self, SourceError> {
        let frames = &request.options.frames;
        let photo::ReadPhoto { color, depth, depth_from, mut findings } = photo::read_photo(path, request)?;
        let correction = |map| Misalignment::measure(map, &color)?.correction(map, &color);
        findings.is_fitting = depth.as_ref().is_some_and(|map| correction(map).is_none());
        let camera = Photo::new(color, &path.display().to_string(), frames.repeat, frames.frames);
        let depth = depth.map(|map| Box::new(ConstantDepth(map)) as Box<dyn DepthSource>);
        Ok(Self { depth, depth_from, findings, ..Self::without_depth(Box::new(camera)) })
    }
}

/// Returns the kind of a recording's depth.
pub(super) fn recorded_depth_origin(recording: &Recording) -> DepthOrigin {
    match recording.has_depth() {
        false => DepthOrigin::Nothing,
        true if recording.has_relative_depth() => DepthOrigin::Relative,
        true if recording.has_depth_in_units() => DepthOrigin::Units,
        true => DepthOrigin::Metres,
    }
}

/// Warns of options that a recording has no use for.
fn warn_of_own_properties(recording: &Recording, frames: &Frames) {
    if let Some(fps) = frames.fps.filter(|_| recording.has_times()) {
        tracing::warn!("without effect here: --fps {fps} (a recording has its own)");
    }
    if !frames.topic.is_empty() && !recording.has_topics() {
        tracing::warn!("without effect here: --topic {} (the recording has no topics)", frames.topic.join(","));
    }
    if let Some(Size { width, height }) = frames.size.filter(|_| !recording.is_chosen_by_size()) {
        tracing::warn!("without effect here: --size {width}x{height} (a recording has its own)");
    }
}
