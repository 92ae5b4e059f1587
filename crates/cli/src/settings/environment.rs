//! Settings in the environment: warnings of unknown variables, and messages that name the variable behind an error.

use std::ffi::OsString;
use std::os::unix::ffi::OsStrExt;

use super::file::SettingsFile;
use super::layers::Layers;
use super::table::{PREFIX, active_variable, all_settings_command, environment_variable, suggest_setting};
use crate::log;
use bokehcam::look::settings;

/// Variables of this program that are not settings: the path of the settings file, the folder of its networks, and those
/// of the tests.
const NOT_SETTINGS: [&str; 7] = ["CONFIG", "DATA", "MODELS", "NO_VM", "PAIR", "SCREENSHOTS", "VM"];

/// Warns of variables with the prefix `BOKEHCAM_` that match no setting.
pub fn warn_of_unknown() {
    describe_unknown().iter().for_each(|what| log::warn(what));
}

/// Describes the variables with the prefix `BOKEHCAM_` that match no setting; `None` if there are none.
pub fn describe_unknown() -> Option<String> {
    let settings = all_settings_command();
    let names = settings.get_arguments().flat_map(|arg| {
        arg.get_long()
            .into_iter()
            .chain(arg.get_all_aliases().unwrap_or_default())
            .map(environment_variable)
            .collect::<Vec<_>>()
    });
    let known: Vec<String> = names.collect();
    let names = std::env::vars_os().map(|(name, _)| name.to_string_lossy().into_owned());
    let is_unknown = |name: &String| {
        let rest = name.strip_prefix(PREFIX);
        rest.is_some_and(|rest| !NOT_SETTINGS.contains(&rest)) && !known.contains(name)
    };
    let mut unknown: Vec<String> = names.filter(is_unknown).map(|name| suggest_variable(&name)).collect();
    unknown.sort();
    (!unknown.is_empty()).then(|| format!("in the environment there is {}", unknown.join(" and ")))
}

fn suggest_variable(name: &str) -> String {
    let setting = name.strip_prefix(PREFIX).unwrap_or(name).replace('_', "-").to_lowercase();
    let hint = suggest_setting(&setting)
        .map_or(String::new(), |near| format!(", did you mean {}?", environment_variable(&near)));
    format!("{name}, which is not a setting{hint}")
}

/// Appends to an error message the origin of the settings that it names, unless they are arguments: environment
/// variables, if a value is invalid, and keys of the settings file.
pub fn append_origins(
    message: &str,
    args: &[OsString],
    are_wrong: bool,
    file: Option<(&SettingsFile, &Layers)>,
) -> String {
    let message = &if are_wrong { with_variables(message, args) } else { message.to_owned() };
    let options: Vec<&str> = find_options(message).filter(|_| are_wrong).collect();
    let keys = file.map_or(Vec::new(), |(file, layers)| layers.name_origins(message, &options, file));
    if keys.is_empty() { message.to_owned() } else { format!("{message} ({})", keys.join(", ")) }
}

fn with_variables(message: &str, args: &[OsString]) -> String {
    let mut variables: Vec<String> = find_options(message)
        .filter(|name| !setting_names(name).any(|name| has_option(args, name)))
        .filter_map(|name| {
            let variable = active_variable(name);
            let value = std::env::var_os(&variable).filter(|value| !value.is_empty())?;
            Some(format!("{variable}={}", value.to_string_lossy()))
        })
        .collect();
    variables.dedup();
    match variables.is_empty() {
        true => message.to_owned(),
        false => format!("{message} (in the environment: {})", variables.join(", ")),
    }
}

/// Returns all names of a setting.
fn setting_names(name: &str) -> impl Iterator<Item = &str> {
    let alias = settings::find_setting(name).and_then(settings::Setting::alias);
    [Some(settings::resolve_alias(name)), alias].into_iter().flatten()
}

/// Whether the arguments contain the option `--name`.
fn has_option(args: &[OsString], name: &str) -> bool {
    let is_option = |arg: &OsString| {
        let rest = arg.as_bytes().strip_prefix(b"--").and_then(|rest| rest.strip_prefix(name.as_bytes()));
        rest.is_some_and(|rest| rest.is_empty() || rest[0] == b'=')
    };
    args.iter().any(is_option)
}

/// Finds the options `--name` in a text, without their dashes.
fn find_options(text: &str) -> impl Iterator<Item = &str> {
    text.match_indices("--").filter_map(|(at, _)| {
        let rest = &text[at + 2..];
        let end = rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '-').unwrap_or(rest.len());
        Some(&rest[..end]).filter(|name| name.starts_with(|c: char| c.is_ascii_lowercase()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_found_in_what_is_said_of_them() {
        let text = "the argument '--coc-at-infinity <PX>' cannot be used with: --f-number; -- no more --";
        assert_eq!(find_options(text).collect::<Vec<_>>(), ["coc-at-infinity", "f-number"]);
        assert_eq!(environment_variable("coc-at-infinity"), "BOKEHCAM_COC_AT_INFINITY");
    }

    #[test]
    fn options_are_found_with_and_without_a_value() {
        let given = ["--rim=0.1", "--focus", "1"].map(OsString::from);
        assert!(has_option(&given, "rim") && has_option(&given, "focus"));
        assert!(!has_option(&given, "foc") && !has_option(&given, "rank"));
    }
}
