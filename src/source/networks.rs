//! Depth from one camera by networks: those that the user names, or those that are installed.

use super::{DepthFrom, OneCamera, Options, Source, SourceError, Wanted};
use crate::depth::focus::{FocusRule, OnPersons, Persons};
use crate::depth::plate::Companion;
use crate::depth::{DepthSource, Seen};
use crate::frame::{ColorImage, DepthMap, Stamp};
use crate::look::Look;

#[cfg(feature = "networks")]
use super::{DepthChoice, NetworkFile};

/// Networks at work, and what they are in a few words.
type Opened = (Box<dyn Companion>, String);

/// Refuses a look that needs real distances, for depth in which `who` knows only relative ones.
///
/// # Errors
/// It does.
pub fn refuse_metres(look: &Look, who: &str) -> Result<(), SourceError> {
    match look.needs_metres() {
        None => Ok(()),
        Some(needs) => SourceError::usage(format!(
            "{needs} needs distances, and {who} only what is nearer than what: use --focus auto or X,Y, and --blur"
        )),
    }
}

/// Opens the networks `chosen`, for a look.
///
/// # Errors
/// One is not installed or cannot be used.
#[cfg(feature = "networks")]
pub(super) fn open(chosen: &OneCamera, wanted: &Wanted) -> Result<Opened, SourceError> {
    use crate::depth::single_camera::{Hints, SingleCamera};
    use crate::network::{Task, best};
    let file = |chosen: &Option<NetworkFile>, task: Task| {
        match chosen {
        None => Ok(None),
        Some(NetworkFile::At(file)) => Ok(Some(file.clone())),
        Some(NetworkFile::Installed) => best(task).map(Some).ok_or_else(|| {
            SourceError::NotThere(format!(
                "--depth {task}: no network for it is installed: `bokehcam models get {known}`, or name a file: --depth {task}:FILE",
                known = crate::network::KNOWN.iter().find(|known| known.task == task).map_or("", |known| known.file),
                task = task.name()
            ))
        }),
    }
    };
    let (matte, mono) = (file(&chosen.matte, Task::Matte)?, file(&chosen.mono, Task::Mono)?);
    let options = &wanted.options.networks;
    let hints = Hints {
        scaling: options.network_range.map(super::options::Range::scaling),
        bgr: options.network_order.map(|order| order == super::options::Order::Bgr),
    };
    let runtime = options.network_runtime.unwrap_or_default();
    let networks = SingleCamera::open(matte.as_deref(), mono.as_deref(), &hints, runtime)?;
    let about = networks.describe();
    Ok((Box::new(networks), about))
}

/// The best networks that are installed, if there are any.
#[cfg(feature = "networks")]
pub fn installed() -> OneCamera {
    use crate::network::{self, Task};
    let installed = network::installed();
    let best =
        |task| installed.iter().find(|(known, _)| known.task == task).map(|(_, file)| NetworkFile::At(file.clone()));
    OneCamera { plate: None, matte: best(Task::Matte), mono: best(Task::Mono) }
}

/// The best networks that are installed: this build has none.
#[cfg(not(feature = "networks"))]
pub fn installed() -> OneCamera {
    OneCamera::default()
}

/// Gives a source that has no depth that of the installed networks, if there are any and nothing else is asked for.
#[cfg(feature = "networks")]
pub(super) fn for_lone_camera(source: Source, wanted: &Wanted) -> Source {
    let is_lone = !source.has_depth() && wanted.options.depth_choice == DepthChoice::Auto;
    let needs_metres = wanted.look.is_some_and(|look| look.needs_metres().is_some());
    // A source that is recorded has no look: what it shows is kept, and not what can be made of it at any time.
    if !is_lone || needs_metres || !wanted.look.is_some_and(|look| look.effect.follows_depth()) {
        return source;
    }
    let chosen = installed();
    if chosen.matte.is_none() {
        return source;
    }
    match open(&chosen, wanted) {
        Ok((depth, about)) => {
            let depth: Option<Box<dyn DepthSource>> = Some(depth);
            Source { depth, depth_from: DepthFrom::Networks, networks: Some(about), ..source }
        }
        // They were not asked for.
        Err(error) => {
            tracing::warn!("{error}; going on without it");
            source
        }
    }
}

/// What finds the person to focus on, and what that is in a few words; `None` where no network for that is installed.
#[cfg(feature = "networks")]
fn persons(wanted: &Wanted) -> Option<(Persons, String)> {
    let finder = OneCamera { mono: None, ..installed() };
    finder.matte.as_ref()?;
    let opened = open(&finder, wanted);
    let told = opened.inspect_err(|error| tracing::warn!("{error}; the focus goes by distance alone"));
    told.ok().map(|(finder, about)| (Persons::new(finder), about))
}

#[cfg(not(feature = "networks"))]
fn persons(_: &Wanted) -> Option<(Persons, String)> {
    None
}

/// Lets the installed network find the person to focus on in depth that was measured, where there is one.
pub(super) fn for_focus(mut source: Source, wanted: &Wanted) -> Source {
    let is_used = wanted.look.is_some_and(|look| look.effect.follows_depth()) && !source.depth_from.is_of_pictures();
    if source.depth.is_some()
        && is_used
        && let Some((persons, about)) = persons(wanted)
    {
        let is_matched = source.depth_from == DepthFrom::Eyes;
        let on_persons = |depth| Box::new(OnPersons::new(depth, persons, is_matched)) as Box<dyn DepthSource>;
        source.depth = source.depth.map(on_persons);
        source.persons = Some(about);
    }
    source
}

/// The same for the map of one picture that comes from a file.
pub fn find_person(options: &Options, look: &Look, color: &ColorImage, map: &mut DepthMap) {
    let is_used = look.effect.follows_depth() && look.focus == FocusRule::Auto;
    if is_used && let Some((mut persons, _)) = persons(&Wanted { options, look: Some(look) }) {
        let stamp = Stamp { index: 0, time_ns: 0, captured_ns: None };
        persons.mark(Seen { stamp, color, right: None }, map);
    }
}

#[cfg(not(feature = "networks"))]
pub(super) fn open(_: &OneCamera, _: &Wanted) -> Result<Opened, SourceError> {
    SourceError::usage("--depth matte and mono: this build leaves networks out (feature `networks`)")
}

#[cfg(not(feature = "networks"))]
pub(super) fn for_lone_camera(source: Source, _: &Wanted) -> Source {
    source
}
