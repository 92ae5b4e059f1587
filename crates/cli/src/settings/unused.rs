//! Warnings of given settings without effect in this run, in one line per command.
//!
//! Covers flags, the environment and a preset; the settings file is meant for all runs.

use super::layers::Setting;
use super::table::{WINDOW_START, WINDOW_STATE, active_variable};
use crate::log;
use bokehcam::bokeh::Method;
use bokehcam::look::{Effect, Look, Strength, Value};
use bokehcam_live::source::{DepthOrigin, Kind};

/// Facts of a run that decide which settings have an effect.
#[derive(Clone, Copy, Debug)]
pub struct RunFacts {
    /// Origin of the frames.
    pub source: FrameOrigin,
    /// Origin of the depth.
    pub depth: DepthOrigin,
    /// Whether the effect uses depth.
    pub uses_depth: bool,
    /// Effect of the blur.
    pub effect: Effect,
    /// Whether the strength is given as a lens.
    pub lens: bool,
    /// Whether every pixel gathers its blur, by the exact method.
    pub gathers: bool,
    /// Whether frames come in real time.
    pub realtime: bool,
    /// Whether the user chose the CPU backend.
    pub cpu_only: bool,
    /// Whether the run encodes a video.
    pub compresses: bool,
    /// Whether the run has a window.
    pub window: bool,
}

impl RunFacts {
    /// Returns these facts with those of a source of frames, the origin of its depth, and the look.
    pub fn for_look(self, source: FrameOrigin, depth: DepthOrigin, look: &Look) -> Self {
        let (effect, lens) = (look.effect, matches!(look.strength, Strength::Lens(_)));
        let (uses_depth, gathers) = (effect.follows_depth(), look.method == Method::Gather);
        Self { source, depth, uses_depth, effect, lens, gathers, ..self }
    }
}

impl Default for RunFacts {
    /// Returns the facts of an unblurred still picture.
    fn default() -> Self {
        Self {
            source: FrameOrigin::Picture,
            depth: DepthOrigin::Nothing,
            uses_depth: false,
            effect: Effect::None,
            lens: false,
            gathers: false,
            realtime: false,
            cpu_only: false,
            compresses: false,
            window: false,
        }
    }
}

/// Origin of the frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameOrigin {
    /// A source of frames.
    Source(Kind),
    Picture,
    /// The scene of `bench`.
    Bench,
}

/// Returns the reason why a setting has no effect in a run, if so.
type Reason = fn(&RunFacts) -> Option<&'static str>;

/// Settings, and their condition for an effect.
type Requirement = (&'static [&'static str], Reason);

/// Conditions that depend on the source alone.
const NEEDS_OF_SOURCE: &[Requirement] = &[
    (&["size", "fps"], |run| match run.source {
        FrameOrigin::Source(Kind::Stdin) => Some("the stream on standard input has its own"),
        FrameOrigin::Source(Kind::Demo) => Some("the demonstration has its own"),
        FrameOrigin::Source(Kind::Photo) => Some("a photo has its own size and only one frame"),
        _ => None,
    }),
    (&["topic"], |run| match run.source {
        // The recording itself says whether it has topics.
        FrameOrigin::Source(Kind::Recording) => None,
        _ => Some("the source is not a ROS recording"),
    }),
    (&["format", "control"], |run| {
        (run.source != FrameOrigin::Source(Kind::Camera)).then_some("the source is not a camera")
    }),
];

/// Other conditions.
const NEEDS: &[Requirement] = &[
    (&["depth-invalid", "depth-unit"], needs_depth_pictures),
    (&["depth-scale"], |run| match run.depth {
        DepthOrigin::Metres => Some("this depth is already in metres"),
        DepthOrigin::Relative => Some("relative depth has no scale"),
        _ => needs_depth_pictures(run),
    }),
    (&["depth-calibration"], |run| match run.source {
        FrameOrigin::Picture | FrameOrigin::Bench | FrameOrigin::Source(Kind::Photo) => {
            Some("the map of a single picture shows its view")
        }
        _ if run.uses_depth && matches!(run.depth, DepthOrigin::Units | DepthOrigin::Metres) => None,
        _ => Some("depth does not come from a depth camera, or its recording"),
    }),
    (&["depth-invert"], |run| {
        (run.depth != DepthOrigin::Relative).then_some("only inverse depth is inverted: add --depth-unit inverse")
    }),
    (&["max-disparity", "rectified", "calib", "focal-px", "baseline-m", "doffs-px"], |run| {
        (run.depth != DepthOrigin::Stereo).then_some("depth does not come from two cameras")
    }),
    (&["network-range", "network-order"], |run| {
        (run.depth != DepthOrigin::Networks).then_some("no network makes the depth")
    }),
    (&["focus"], |run| needs_dof(run).filter(|_| !run.lens)),
    (&["focus-range", "method"], needs_dof),
    (&["refine", "behind"], |run| match run.source {
        FrameOrigin::Bench => Some("the scene has its own background and exact depth"),
        _ => needs_dof(run),
    }),
    (&["background-memory"], |run| match run.depth {
        DepthOrigin::Plate => Some("the plate already shows the background"),
        _ => needs_frames(run).or(needs_dof(run)),
    }),
    (&["follow"], |run| needs_frames(run).or(needs_dof(run))),
    (&["reuse"], |run| needs_frames(run).or(needs_blur(run))),
    (&["privacy"], |run| match run.uses_depth && run.gathers {
        true => Some("the method gather keeps all detail: leave --method out"),
        false => needs_blur(run),
    }),
    (&["tilt"], |run| (run.effect != Effect::TiltShift).then_some("the effect is not tilt-shift")),
    (&["blur", "f-number", "focal-length", "sensor-width"], |run| match run.source {
        FrameOrigin::Bench => Some("`bench` takes --coc"),
        _ => needs_blur(run),
    }),
    (&["max-coc", "aperture", "intensity", "rim", "rank", "highlights", "quality"], needs_blur),
    (&["backend"], needs_executor),
    (&["adapter"], |run| needs_executor(run).or(run.cpu_only.then_some("--backend cpu uses no GPU"))),
    (&["threads"], |run| needs_executor(run).filter(|_| !run.compresses)),
    (&["budget-ms"], |run| match run.realtime {
        true => needs_blur(run),
        false => Some("frames do not come in real time: add --pace realtime"),
    }),
    (&WINDOW_STATE, needs_window),
    (&WINDOW_START, needs_window),
];

const NO_DEPTH: &str = "there is no depth";
const DEPTH_UNUSED: &str = "the effect does not use depth";

/// Condition of settings of depth pictures: that there are some, and that the effect uses depth.
fn needs_depth_pictures(run: &RunFacts) -> Option<&'static str> {
    match run.depth {
        DepthOrigin::Nothing => Some(NO_DEPTH),
        DepthOrigin::Stereo | DepthOrigin::Networks | DepthOrigin::Plate => Some("there are no depth pictures"),
        DepthOrigin::Units | DepthOrigin::Metres | DepthOrigin::Relative => (!run.uses_depth).then_some(DEPTH_UNUSED),
    }
}

/// Condition of depth-of-field settings: an effect that uses depth.
fn needs_dof(run: &RunFacts) -> Option<&'static str> {
    let why = if run.depth == DepthOrigin::Nothing { NO_DEPTH } else { DEPTH_UNUSED };
    (!run.effect.follows_depth()).then_some(why)
}

/// Condition of settings that carry over from frame to frame.
fn needs_frames(run: &RunFacts) -> Option<&'static str> {
    (!matches!(run.source, FrameOrigin::Source(_))).then_some("a single picture is blurred from scratch, and whole")
}

/// Condition of blur settings: an effect that blurs.
fn needs_blur(run: &RunFacts) -> Option<&'static str> {
    (run.effect == Effect::None).then_some("nothing is blurred")
}

/// Condition of executor settings: a blur or a stereo match to compute.
fn needs_executor(run: &RunFacts) -> Option<&'static str> {
    needs_blur(run).filter(|_| run.depth != DepthOrigin::Stereo)
}

/// Condition of window settings: a window.
fn needs_window(run: &RunFacts) -> Option<&'static str> {
    (!run.window).then_some("there is no window")
}

/// Warns of the given settings without effect in this run.
pub fn warn_of_unused(given: &[Setting], run: &RunFacts) {
    format_line(find_unused(given, run)).iter().for_each(|line| log::warn(line));
}

/// Returns the warning about changed settings without effect in this run.
pub fn describe_unused(changed: &[Value], run: &RunFacts) -> Option<String> {
    let given: Vec<Setting> = changed
        .iter()
        .map(|(name, value)| Setting {
            name: (*name).into(),
            value: Some(value.clone()),
            origin: "flag",
            help: String::new(),
        })
        .collect();
    format_line(find_unused(&given, run))
}

/// Warns of the given settings without effect on this kind of source; all others can be changed in the window.
pub fn warn_by_source(given: &[Setting], source: Kind) {
    let run = RunFacts { source: FrameOrigin::Source(source), ..RunFacts::default() };
    format_line(find_unmet(NEEDS_OF_SOURCE, given, &run)).iter().for_each(|line| log::warn(line));
}

fn find_unused<'a>(given: &'a [Setting], run: &RunFacts) -> Vec<(&'a Setting, &'static str)> {
    find_unmet(&[NEEDS_OF_SOURCE, NEEDS].concat(), given, run)
}

/// Finds the settings with an unmet condition, and the reasons.
fn find_unmet<'a>(needs: &[Requirement], given: &'a [Setting], run: &RunFacts) -> Vec<(&'a Setting, &'static str)> {
    let why = |setting: &Setting| {
        let (_, why) = needs.iter().find(|(names, _)| names.contains(&setting.name.as_str()))?;
        why(run)
    };
    given.iter().filter_map(|setting| Some((setting, why(setting)?))).collect()
}

/// Formats the warning in one line, grouped by reason.
fn format_line(unused: Vec<(&Setting, &str)>) -> Option<String> {
    let mut reasons: Vec<&str> = Vec::new();
    for (_, why) in &unused {
        if !reasons.contains(why) {
            reasons.push(why);
        }
    }
    let grouped = |why: &&str| {
        let names: Vec<String> =
            unused.iter().filter(|(_, other)| other == why).map(|(s, _)| format_as_given(s)).collect();
        format!("{} ({why})", names.join(", "))
    };
    let text = || format!("without effect here: {}", reasons.iter().map(grouped).collect::<Vec<_>>().join("; "));
    (!reasons.is_empty()).then(text)
}

/// Formats a setting as the user wrote it.
fn format_as_given(setting: &Setting) -> String {
    let Setting { name, value, origin, .. } = setting;
    let value = value.as_deref().unwrap_or_default();
    match *origin {
        "flag" => format!("--{name} {value}"),
        "environment" => format!("{}={value}", active_variable(name)),
        origin => format!("{name} = {value} of the {origin}"),
    }
}

/// Warns that everything is blurred equally for lack of depth; not for users who chose to do without.
pub fn warn_of_no_depth(source: FrameOrigin) {
    const NETWORK: &str = "`bokehcam models get` installs a network that finds people, or ";
    let (network, other) = match source {
        FrameOrigin::Picture => (
            NETWORK,
            "--mask FILE marks the person, --depth-map FILE or a map NAME-depth.png beside NAME gives the depth",
        ),
        FrameOrigin::Source(Kind::Photo) => (NETWORK, "a map NAME-depth.png beside NAME gives the depth"),
        FrameOrigin::Source(Kind::Recording | Kind::Video) => {
            (NETWORK, "--depth FOLDER uses the depth of another recording")
        }
        FrameOrigin::Source(Kind::Camera) => (NETWORK, "use --depth plate (step aside once)"),
        FrameOrigin::Source(_) | FrameOrigin::Bench => ("", "--depth NAME uses a depth camera"),
    };
    log::warn(&format!(
        "{NO_DEPTH}, so everything is blurred: {network}{other}; --effect tilt-shift keeps a band sharp"
    ));
}

#[cfg(test)]
mod tests {
    use super::super::table::all_settings_command;
    use super::*;

    fn setting(name: &str) -> Setting {
        Setting { name: name.to_owned(), value: Some("1".into()), origin: "flag", help: String::new() }
    }

    #[test]
    fn every_name_in_the_table_is_a_setting_and_there_once() {
        let mut names: Vec<&str> =
            [NEEDS_OF_SOURCE, NEEDS].concat().iter().flat_map(|(names, _)| *names).copied().collect();
        let all = all_settings_command();
        let is_setting = |name: &&str| all.get_arguments().any(|arg| arg.get_long() == Some(name));
        let is_of_window = |name: &&str| WINDOW_STATE.contains(name) || WINDOW_START.contains(name);
        let window = |name: &&str| cfg!(feature = "window") || !is_of_window(name);
        assert!(names.iter().all(|name| is_setting(name) || !window(name)), "{names:?}");
        names.sort_unstable();
        assert!(names.windows(2).all(|pair| pair[0] != pair[1]));
    }

    #[test]
    fn a_setting_has_an_effect_where_what_it_needs_is_there() {
        let blurred = RunFacts { effect: Effect::Blur, ..RunFacts::default() };
        let why = |name: &str, run: &RunFacts| find_unused(&[setting(name)], run).first().map(|(_, why)| *why);
        assert_eq!(why("focus", &blurred), Some(NO_DEPTH));
        assert_eq!(why("focus", &RunFacts { lens: true, ..blurred }), None);
        let dof = RunFacts { depth: DepthOrigin::Units, uses_depth: true, effect: Effect::Dof, ..blurred };
        for name in ["focus", "refine", "focus-range", "depth-scale", "method"] {
            assert_eq!(why(name, &dof), None, "{name}");
            assert_eq!(why(name, &RunFacts { depth: DepthOrigin::Nothing, ..blurred }), Some(NO_DEPTH), "{name}");
        }
        assert!(why("depth-scale", &RunFacts { depth: DepthOrigin::Stereo, ..dof }).is_some());
        assert!(
            why("tilt", &dof).is_some() && why("tilt", &RunFacts { effect: Effect::TiltShift, ..blurred }).is_none()
        );
        assert!(why("budget-ms", &dof).is_some() && why("budget-ms", &RunFacts { realtime: true, ..dof }).is_none());
        assert!(why("rim", &RunFacts { effect: Effect::None, ..dof }).is_some() && why("rim", &dof).is_none());
        assert_eq!(why("privacy", &dof), None);
        assert_eq!(
            why("privacy", &RunFacts { effect: Effect::None, uses_depth: false, ..dof }),
            Some("nothing is blurred")
        );
        let exact = RunFacts { gathers: true, ..dof };
        assert!(why("privacy", &exact).is_some_and(|why| why.contains("gather")));
        assert_eq!(why("privacy", &RunFacts { gathers: true, ..blurred }), None, "it is a method for depth");
        for (kind, is_unused) in [(Kind::Recording, false), (Kind::Demo, true), (Kind::Photo, true)] {
            assert_eq!(why("fps", &RunFacts { source: FrameOrigin::Source(kind), ..dof }).is_some(), is_unused);
        }
    }
}
