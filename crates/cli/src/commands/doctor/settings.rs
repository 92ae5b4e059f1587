//! Checks of the user's settings: the settings file, the variables of settings in the environment, and what calls get by
//! both.

use std::ffi::OsString;
use std::path::Path;

use clap::FromArgMatches;

use super::finding::Finding;
use crate::log::one_line;
use crate::options::Every;
use crate::settings::file::SettingsFile;
use crate::settings::layers::Layers;
use crate::settings::look::build_look;
use crate::settings::{environment, table};
use bokehcam::look::{Look, LookFacts, SmallBlur};

const TOPIC: &str = "settings";
const PRIVACY: &str = "privacy";
/// The usual size of a call.
const CALL_SIZE: (u32, u32) = (1280, 720);

/// Checks the settings file, `chosen` or the user's, and the environment.
pub fn check_settings(chosen: Option<&Path>) -> Vec<Finding> {
    let loaded = SettingsFile::load(chosen);
    let privacy = loaded.as_ref().ok().and_then(find_call_look).map(|look| check_privacy(&look));
    let file = match loaded {
        Ok(SettingsFile { path: Some(path), .. }) => Finding::good(TOPIC, format!("{} is valid", path.display())),
        Ok(_) => Finding::good(TOPIC, "there is no settings file: the defaults apply"),
        Err(fault) => {
            let fix = "correct this line; until then every command that reads settings refuses to start";
            Finding::note(TOPIC, fault.to_string(), fix)
        }
    };
    let given = table::with_environment(table::all_settings_command()).try_get_matches_from::<_, OsString>([]);
    let refused = given.err().map(|error| {
        let fault = environment::append_origins(&one_line(&error), &[], true, None);
        Finding::note(
            TOPIC,
            fault,
            "correct or unset this variable; until then commands with this setting refuse to start",
        )
    });
    let unknown = environment::describe_unknown()
        .map(|what| Finding::note(TOPIC, what, "correct the name of the variable, or unset it"));
    [Some(file), refused, unknown, privacy].into_iter().flatten().collect()
}

/// Returns the look that a call gets by the settings file and the environment; `None` if they have a fault.
fn find_call_look(file: &SettingsFile) -> Option<Look> {
    let command = table::with_environment(table::all_settings_command());
    let given = command.clone().try_get_matches_from::<_, OsString>([]).ok()?;
    let layers = Layers::resolve(file, &given).ok()?;
    let matches = layers.apply_defaults(command).try_get_matches_from::<_, OsString>([]).ok()?;
    let every = Every::from_arg_matches(&matches).ok()?;
    let look = build_look(&every.blur, &every.computing.quality).ok()?;
    let facts = LookFacts { has_depth: true, size: CALL_SIZE, is_for_call: true, ..LookFacts::default() };
    Some(look.for_source(&facts))
}

/// Reports whether a call can undo the blur of a look.
fn check_privacy(look: &Look) -> Finding {
    const PRIVATE: &str = "no filter can undo the blur of what is behind in a call";
    match look.small_blur(CALL_SIZE) {
        _ if !look.is_private() => Finding::note(
            PRIVACY,
            "by your settings, a call can undo the blur of what is behind",
            "leave `privacy` out of the settings file and the environment, and an `effect` or `method` without it",
        ),
        Some(SmallBlur { asked_px, min_px, is_raised: false }) => Finding::note(
            PRIVACY,
            format!("by your settings, the blur behind is {asked_px} px at 720 rows: a call can undo it"),
            format!("set `blur` to {min_px} px or more, or `privacy = \"on\"`"),
        ),
        _ => Finding::good(PRIVACY, PRIVATE),
    }
}
