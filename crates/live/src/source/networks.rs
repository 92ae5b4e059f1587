//! Depth from a single camera by networks, either named by the user or installed.

pub use super::installed::find_each_best as installed_networks;
pub(super) use super::installed::open_networks;
use super::{DepthChoice, DepthOrigin, OpenRequest, Options, SingleCameraDepth, Source};
use bokehcam::depth::focus::{FocusRule, PersonDistance, PersonFocus};
use bokehcam::depth::plate::Companion;
use bokehcam::depth::{DepthSource, FrameInput};
use bokehcam::frame::{ColorImage, DepthMap, Stamp};
use bokehcam::look::Look;

/// Opened networks, and a short description of them.
pub(super) type Opened = (Box<dyn Companion>, String);

/// Adds depth of the installed networks to a source without depth, if there are any and no other depth was requested.
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
fn open_person_detector(request: &OpenRequest) -> Option<(PersonDistance, String)> {
    let detector = SingleCameraDepth { mono: None, ..installed_networks() };
    detector.matte.as_ref()?;
    let opened = open_networks(&detector, request);
    let logged = opened.inspect_err(|error| tracing::warn!("{error}; the focus uses distances only"));
    logged.ok().map(|(detector, about)| (PersonDistance::new(detector), about))
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
