//! Depth from a single camera by networks, either named by the user or installed.

use super::{DepthOrigin, OpenRequest, Options, SingleCameraDepth, Source, SourceError};
use bokehcam::depth::focus::{FocusRule, PersonDistance, PersonFocus};
use bokehcam::depth::plate::Companion;
use bokehcam::depth::{DepthSource, FrameInput};
use bokehcam::frame::{ColorImage, DepthMap, Stamp};
use bokehcam::look::Look;

#[cfg(feature = "networks")]
use super::{DepthChoice, NetworkFile};

/// Opened networks, and a short description of them.
type Opened = (Box<dyn Companion>, String);

/// Opens the networks `chosen`, for a look.
///
/// # Errors
/// A network is not installed or cannot be used.
#[cfg(feature = "networks")]
pub(super) fn open_networks(chosen: &SingleCameraDepth, request: &OpenRequest) -> Result<Opened, SourceError> {
    use super::installed::find_best;
    use bokehcam_media::depth::single_camera::{Hints, SingleCamera};
    use bokehcam_media::network::Task;
    let file = |chosen: &Option<NetworkFile>, task: Task| {
        match chosen {
        None => Ok(None),
        Some(NetworkFile::At(file)) => Ok(Some(file.clone())),
        Some(NetworkFile::Installed) => find_best(task).map(Some).ok_or_else(|| {
            SourceError::NotFound(format!(
                "--depth {task}: no network for it is installed: `bokehcam models get {known}`, or name a file: --depth {task}:FILE",
                known = bokehcam_media::network::KNOWN_NETWORKS.iter().find(|known| known.task == task).map_or("", |known| known.file),
                task = task.name()
            ))
        }),
    }
    };
    let (matte, mono) = (file(&chosen.matte, Task::Matte)?, file(&chosen.mono, Task::Mono)?);
    let options = &request.options.networks;
    let hints = Hints {
        scaling: options.network_range.map(super::options::Range::scaling),
        bgr: options.network_order.map(|order| order == super::options::Order::Bgr),
    };
    let networks = SingleCamera::open(matte.as_deref(), mono.as_deref(), &hints)?;
    let about = networks.describe();
    Ok((Box::new(networks), about))
}

/// Returns the best installed networks, if any.
#[cfg(feature = "networks")]
pub fn installed_networks() -> SingleCameraDepth {
    use bokehcam_media::network::Task;
    let installed = super::installed::installed_networks();
    let best =
        |task| installed.iter().find(|(known, _)| known.task == task).map(|(_, file)| NetworkFile::At(file.clone()));
    SingleCameraDepth { plate: None, matte: best(Task::Matte), mono: best(Task::Mono) }
}

/// Returns none, as this build has no networks.
#[cfg(not(feature = "networks"))]
pub fn installed_networks() -> SingleCameraDepth {
    SingleCameraDepth::default()
}

/// Adds depth of the installed networks to a source without depth, if there are any and no other depth was requested.
#[cfg(feature = "networks")]
pub(super) fn add_network_depth(source: Source, request: &OpenRequest) -> Source {
    let is_lone = !source.has_depth() && request.options.depth_choice == DepthChoice::Auto;
    let needs_metres = request.look.is_some_and(Look::needs_metres);
    // A source without a look is being recorded: record only what cannot be computed later.
    if !is_lone || needs_metres || !request.look.is_some_and(|look| look.effect.follows_depth()) {
        return source;
    }
    let chosen = installed_networks();
    if chosen.matte.is_none() {
        return source;
    }
    match open_networks(&chosen, request) {
        Ok((depth, about)) => {
            let depth: Option<Box<dyn DepthSource>> = Some(depth);
            Source { depth, depth_from: DepthOrigin::Networks, networks: Some(about), ..source }
        }
        // The networks were not requested explicitly.
        Err(error) => {
            tracing::warn!("{error}; continuing without it");
            source
        }
    }
}

/// Opens the network that detects the person in focus, with a short description; `None` if none is installed.
#[cfg(feature = "networks")]
fn open_person_detector(request: &OpenRequest) -> Option<(PersonDistance, String)> {
    let detector = SingleCameraDepth { mono: None, ..installed_networks() };
    detector.matte.as_ref()?;
    let opened = open_networks(&detector, request);
    let logged = opened.inspect_err(|error| tracing::warn!("{error}; the focus uses distances only"));
    logged.ok().map(|(detector, about)| (PersonDistance::new(detector), about))
}

#[cfg(not(feature = "networks"))]
fn open_person_detector(_: &OpenRequest) -> Option<(PersonDistance, String)> {
    None
}

/// Adds person detection for the focus to a source with measured depth, if a network is installed.
pub(super) fn add_person_detection(mut source: Source, request: &OpenRequest) -> Source {
    let is_used = request.look.is_some_and(|look| look.effect.follows_depth()) && !source.depth_from.is_replaceable();
    if source.depth.is_some()
        && is_used
        && let Some((persons, about)) = open_person_detector(request)
    {
        let is_matched = source.depth_from == DepthOrigin::Stereo;
        let on_persons = |depth| Box::new(PersonFocus::new(depth, persons, is_matched)) as Box<dyn DepthSource>;
        source.depth = source.depth.map(on_persons);
        source.persons = Some(about);
    }
    source
}

/// Detects the person in focus for the map of a single picture from a file.
pub fn find_person(options: &Options, look: &Look, color: &ColorImage, map: &mut DepthMap) {
    let is_used = look.effect.follows_depth() && look.focus == FocusRule::Auto;
    if is_used
        && let Some((mut persons, _)) = open_person_detector(&OpenRequest { options, look: Some(look), photo: None })
    {
        let stamp = Stamp { index: 0, time_ns: 0, captured_ns: None };
        persons.set_person_distance(FrameInput { stamp, color, right: None }, map);
    }
}

#[cfg(not(feature = "networks"))]
pub(super) fn open_networks(_: &SingleCameraDepth, _: &OpenRequest) -> Result<Opened, SourceError> {
    SourceError::usage_error("--depth matte and mono: this build leaves networks out (feature `networks`)")
}

#[cfg(not(feature = "networks"))]
pub(super) fn add_network_depth(source: Source, _: &OpenRequest) -> Source {
    source
}
