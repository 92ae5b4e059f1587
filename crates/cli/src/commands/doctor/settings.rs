//! Checks of the user's settings: the settings file, and the variables of settings in the environment.

use std::ffi::OsString;
use std::path::Path;

use super::finding::Finding;
use crate::log::one_line;
use crate::settings::file::SettingsFile;
use crate::settings::{environment, table};

const TOPIC: &str = "settings";

/// Checks the settings file, `chosen` or the user's, and the environment.
pub fn check_settings(chosen: Option<&Path>) -> Vec<Finding> {
    let file = match SettingsFile::load(chosen) {
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
    [Some(file), refused, unknown].into_iter().flatten().collect()
}
