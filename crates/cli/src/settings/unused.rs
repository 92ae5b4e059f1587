//! Warnings of settings that were given and have no effect in this run, in one line for every command.
//!
//! Given are those of flags, the environment and a preset; the settings file is meant for all runs.

use super::layers::Setting;
use super::table::{GIVEN_TO_WINDOW, STATED_BY_WINDOW, given_variable};
use crate::log;
use bokehcam::look::{Effect, Value};
use bokehcam::source::{DepthFrom, Kind};

/// What decides in a run which settings have an effect.
#[derive(Clone, Copy, Debug)]
pub struct Run {
    /// What frames come from.
    pub source: From,
    /// What depth comes from.
    pub depth: DepthFrom,
    /// Whether the effect uses depth.
    pub uses_depth: bool,
    /// What the blur follows.
    pub effect: Effect,
    /// Whether the strength is that of a lens.
    pub lens: bool,
    /// Whether frames come in real time.
    pub realtime: bool,
    /// Whether the user chose the CPU backend.
    pub cpu_only: bool,
    /// Whether a video is compressed.
    pub compresses: bool,
    /// Whether there is a window.
    pub window: bool,
}

impl Default for Run {
    /// A picture that is not blurred.
    fn default() -> Self {
        Self {
            source: From::Picture,
            depth: DepthFrom::Nothing,
            uses_depth: false,
            effect: Effect::None,
            lens: false,
            realtime: false,
            cpu_only: false,
            compresses: false,
            window: false,
        }
    }
}

/// What frames come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum From {
    /// A source of frames.
    Source(Kind),
    Picture,
    /// The scene that is measured.
    Bench,
}

/// Why a setting has no effect in a run; `None` where it has one.
type Why = fn(&Run) -> Option<&'static str>;

/// Settings, and what they need to have an effect.
type Need = (&'static [&'static str], Why);

/// What settings need of the source alone.
const NEEDS_OF_SOURCE: &[Need] = &[
    (&["size", "fps"], |run| match run.source {
        From::Source(Kind::Recording) => Some("a recording has its own"),
        From::Source(Kind::Demo) => Some("the demonstration has its own"),
        From::Source(Kind::Photo) => Some("a photo has its own size, and stands still"),
        _ => None,
    }),
    (&["format", "control"], |run| (run.source != From::Source(Kind::Camera)).then_some("the source is no camera")),
];

/// What other settings need.
const NEEDS: &[Need] = &[
    (&["depth-scale", "depth-invalid"], |run| match run.depth {
        DepthFrom::Nothing => Some(NO_DEPTH),
        DepthFrom::Metres | DepthFrom::Eyes => Some("this depth is in metres already"),
        DepthFrom::Relative => Some("relative depth has no scale"),
        DepthFrom::Networks => Some("networks give no depth pictures"),
        DepthFrom::Plate => Some("a plate gives no depth pictures"),
        DepthFrom::Units if run.uses_depth => None,
        DepthFrom::Units => Some(DEPTH_UNUSED),
    }),
    (&["depth-unit"], |run| match run.depth {
        DepthFrom::Units | DepthFrom::Relative | DepthFrom::Metres => None,
        DepthFrom::Nothing => Some(NO_DEPTH),
        _ => Some("depth comes from no pictures of it"),
    }),
    (&["depth-invert"], |run| {
        (run.depth != DepthFrom::Relative).then_some("only inverse depth is inverted: add --depth-unit inverse")
    }),
    (&["max-disparity", "rectified", "calib", "focal-px", "baseline-m", "doffs-px"], |run| {
        (run.depth != DepthFrom::Eyes).then_some("depth is not taken from two eyes")
    }),
    (&["network-runtime", "network-range", "network-order"], |run| {
        (run.depth != DepthFrom::Networks).then_some("no network makes the depth")
    }),
    (&["focus"], |run| if run.lens { None } else { dof(run) }),
    (&["focus-range", "method"], dof),
    (&["refine"], |run| if run.source == From::Bench { Some("the scene's depth is exact") } else { dof(run) }),
    (&["background-memory"], |run| match (run.source, run.depth) {
        (From::Picture | From::Bench, _) => Some("a picture on its own has nothing to remember"),
        (_, DepthFrom::Plate) => Some("the plate has what lies behind"),
        _ => dof(run),
    }),
    (&["behind"], |run| if run.source == From::Bench { Some("the scene is its own") } else { dof(run) }),
    (&["follow"], |run| match run.source {
        From::Picture | From::Bench => Some("a picture on its own is shown as a whole"),
        From::Source(_) => dof(run),
    }),
    (&["tilt"], |run| (run.effect != Effect::TiltShift).then_some("the effect is not tilt-shift")),
    (&["blur", "f-number", "focal-length", "sensor-width"], |run| {
        if run.source == From::Bench { Some("`bench` takes --coc") } else { blur(run) }
    }),
    (&["max-coc", "aperture", "intensity", "rim", "rank", "highlights", "quality"], blur),
    (&["backend"], computed),
    (&["adapter"], |run| computed(run).or(run.cpu_only.then_some("--backend cpu takes no GPU"))),
    (&["threads"], |run| computed(run).filter(|_| !run.compresses)),
    (&["budget-ms"], |run| match run.realtime {
        true => blur(run),
        false => Some("frames do not come in real time: add --pace realtime"),
    }),
    (&STATED_BY_WINDOW, windowless),
    (&GIVEN_TO_WINDOW, windowless),
];

const NO_DEPTH: &str = "there is no depth";
const DEPTH_UNUSED: &str = "the effect does not use depth";

/// Settings of depth of field need the effect that uses depth.
fn dof(run: &Run) -> Option<&'static str> {
    match (run.effect, run.depth) {
        (effect, _) if effect.follows_depth() => None,
        (_, DepthFrom::Nothing) => Some(NO_DEPTH),
        _ => Some(DEPTH_UNUSED),
    }
}

/// Settings of the blur need any effect that blurs.
fn blur(run: &Run) -> Option<&'static str> {
    (run.effect == Effect::None).then_some("nothing is blurred")
}

/// Settings of what computes need something to compute.
fn computed(run: &Run) -> Option<&'static str> {
    blur(run).filter(|_| run.depth != DepthFrom::Eyes)
}

/// Settings of the window need one.
fn windowless(run: &Run) -> Option<&'static str> {
    (!run.window).then_some("there is no window")
}

/// Warns of the given settings that have no effect in this run.
pub fn warn(given: &[Setting], run: &Run) {
    line_of(unused(given, run)).iter().for_each(|line| log::warn(line));
}

/// The warning of settings that were changed in this run to no effect.
pub fn note(changed: &[Value], run: &Run) -> Option<String> {
    let given: Vec<Setting> = changed
        .iter()
        .map(|(name, value)| Setting {
            name: (*name).into(),
            value: Some(value.clone()),
            origin: "flag",
            help: String::new(),
        })
        .collect();
    line_of(unused(&given, run))
}

/// Warns of the given settings that have no effect with this kind of source; all else can be changed in the window.
#[cfg(feature = "window")]
pub fn warn_by_source(given: &[Setting], source: Kind) {
    let run = Run { source: From::Source(source), realtime: true, window: true, ..Run::default() };
    line_of(without(NEEDS_OF_SOURCE, given, &run)).iter().for_each(|line| log::warn(line));
}

fn unused<'a>(given: &'a [Setting], run: &Run) -> Vec<(&'a Setting, &'static str)> {
    without(&[NEEDS_OF_SOURCE, NEEDS].concat(), given, run)
}

/// Those of the settings that miss what they need, and why.
fn without<'a>(needs: &[Need], given: &'a [Setting], run: &Run) -> Vec<(&'a Setting, &'static str)> {
    let why = |setting: &Setting| {
        let (_, why) = needs.iter().find(|(names, _)| names.contains(&setting.name.as_str()))?;
        why(run)
    };
    given.iter().filter_map(|setting| Some((setting, why(setting)?))).collect()
}

/// The warning in one line, with the settings of one reason together.
fn line_of(unused: Vec<(&Setting, &str)>) -> Option<String> {
    let mut reasons: Vec<&str> = Vec::new();
    for (_, why) in &unused {
        if !reasons.contains(why) {
            reasons.push(why);
        }
    }
    let grouped = |why: &&str| {
        let names: Vec<String> = unused.iter().filter(|(_, other)| other == why).map(|(s, _)| as_given(s)).collect();
        format!("{} ({why})", names.join(", "))
    };
    let text = || format!("without effect here: {}", reasons.iter().map(grouped).collect::<Vec<_>>().join("; "));
    (!reasons.is_empty()).then(text)
}

/// A setting as the user wrote it, and where.
fn as_given(setting: &Setting) -> String {
    let Setting { name, value, origin, .. } = setting;
    let value = value.as_deref().unwrap_or_default();
    match *origin {
        "flag" => format!("--{name} {value}"),
        "environment" => format!("{}={value}", given_variable(name)),
        origin => format!("{name} = {value} of the {origin}"),
    }
}

/// Warns that all is blurred alike, as there is no depth. Not for those who chose to do without.
pub fn warn_of_no_depth(source: From) {
    let fix = match source {
        From::Picture => {
            "`bokehcam models get` brings what finds the person, --mask FILE says where it is, --depth-map FILE or a map \
             NAME-depth.png beside NAME gives its depth"
        }
        From::Source(Kind::Photo) => {
            "`bokehcam models get` brings what finds the person, a map NAME-depth.png beside NAME gives its depth"
        }
        From::Source(Kind::Recording) => {
            "`bokehcam models get` brings what finds the person, --depth FOLDER takes another recording's"
        }
        From::Source(Kind::Camera) => {
            "`bokehcam models get` brings what finds the person, or --depth plate (step aside once)"
        }
        From::Source(_) | From::Bench => "--depth NAME takes a depth camera's",
    };
    log::warn(&format!("{NO_DEPTH}, so all is blurred: {fix}; --effect tilt-shift keeps a band sharp"));
}

#[cfg(test)]
mod tests {
    use super::super::table::all_settings;
    use super::*;

    fn setting(name: &str) -> Setting {
        Setting { name: name.to_owned(), value: Some("1".into()), origin: "flag", help: String::new() }
    }

    const RUN: Run = Run {
        source: From::Picture,
        depth: DepthFrom::Nothing,
        uses_depth: false,
        effect: Effect::Blur,
        lens: false,
        realtime: false,
        cpu_only: false,
        compresses: false,
        window: false,
    };

    #[test]
    fn every_name_in_the_table_is_a_setting_and_there_once() {
        let mut names: Vec<&str> =
            [NEEDS_OF_SOURCE, NEEDS].concat().iter().flat_map(|(names, _)| *names).copied().collect();
        let all = all_settings();
        let is_camera = |name: &&str| ["format", "control"].contains(name);
        let is_setting = |name: &&str| all.get_arguments().any(|arg| arg.get_long() == Some(name));
        let is_of_window = |name: &&str| STATED_BY_WINDOW.contains(name) || GIVEN_TO_WINDOW.contains(name);
        let window = |name: &&str| cfg!(feature = "window") || !is_of_window(name);
        assert!(names.iter().all(|name| is_setting(name) || is_camera(name) || !window(name)), "{names:?}");
        names.sort_unstable();
        assert!(names.windows(2).all(|pair| pair[0] != pair[1]));
    }

    #[test]
    fn a_setting_has_an_effect_where_what_it_needs_is_there() {
        let why = |name: &str, run: &Run| unused(&[setting(name)], run).first().map(|(_, why)| *why);
        assert_eq!(why("focus", &RUN), Some(NO_DEPTH));
        assert_eq!(why("focus", &Run { lens: true, ..RUN }), None);
        let dof = Run { depth: DepthFrom::Units, uses_depth: true, effect: Effect::Dof, ..RUN };
        for name in ["focus", "refine", "focus-range", "depth-scale", "method"] {
            assert_eq!(why(name, &dof), None, "{name}");
            assert_eq!(why(name, &Run { depth: DepthFrom::Nothing, ..RUN }), Some(NO_DEPTH), "{name}");
        }
        assert!(why("depth-scale", &Run { depth: DepthFrom::Eyes, ..dof }).is_some());
        assert!(why("tilt", &dof).is_some() && why("tilt", &Run { effect: Effect::TiltShift, ..RUN }).is_none());
        assert!(why("budget-ms", &dof).is_some() && why("budget-ms", &Run { realtime: true, ..dof }).is_none());
        assert!(why("rim", &Run { effect: Effect::None, ..dof }).is_some() && why("rim", &dof).is_none());
        for kind in [Kind::Recording, Kind::Demo] {
            assert!(why("fps", &Run { source: From::Source(kind), ..dof }).is_some());
        }
    }
}
