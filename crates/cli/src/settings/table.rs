//! Settings by name: a setting's environment variable and its key in the settings file follow from its flag's name, and
//! the flag's parser reads all three.

use std::collections::BTreeMap;
use std::ffi::OsString;

use clap::error::{ContextKind, ErrorKind};
use clap::{Arg, ArgMatches, Args, Command};

use crate::commands::WITHOUT_SETTINGS;
use crate::options::Every;
use bokehcam::look::settings;

/// Values of settings by the names of their flags, without dashes; each as written after its flag.
pub type Values = BTreeMap<String, String>;

/// Prefix of the variables of settings.
pub const PREFIX: &str = "BOKEHCAM_";

/// Window-only settings that the window writes into composed commands with its current values.
pub const WINDOW_STATE: [&str; 7] = ["show", "split", "full-screen", "panel", "text-scale", "single-keys", "fresh"];
/// The other window-only settings, which keep their initial values.
pub const WINDOW_START: [&str; 3] = ["language", "theme", "save-to"];

/// Returns the environment variable of a setting: `BOKEHCAM_` and the flag's name in capitals.
pub fn environment_variable(setting: &str) -> String {
    format!("{PREFIX}{}", setting.replace('-', "_").to_uppercase())
}

/// Returns the variable that sets a setting: that of its alias if only that one is set.
pub fn active_variable(setting: &str) -> String {
    let by_name = environment_variable(setting);
    let other = settings::find_setting(setting).and_then(settings::Setting::alias).map(environment_variable);
    if is_set(&by_name) { by_name } else { other.filter(|other| is_set(other)).unwrap_or(by_name) }
}

/// Whether a variable is set; an empty one counts as unset.
fn is_set(variable: &str) -> bool {
    std::env::var_os(variable).is_some_and(|value| !value.is_empty())
}

/// Assigns every setting its environment variable.
pub fn with_environment(command: Command) -> Command {
    map_settings(command, &|arg, name| with_variable(arg, active_variable(name)))
}

/// Assigns an option a variable, if that is set.
pub fn with_variable(arg: Arg, variable: String) -> Arg {
    if is_set(&variable) { arg.env(variable).hide_env(true) } else { arg }
}

/// Returns a command with every setting and nothing else.
pub fn all_settings_command() -> Command {
    Every::augment_args(Command::new("settings").disable_help_flag(true).no_binary_name(true))
}

/// Whether a setting of this name exists.
pub fn is_setting(name: &str) -> bool {
    all_settings_command().get_arguments().any(|arg| arg.get_long() == Some(settings::resolve_alias(name)))
}

/// Returns the setting that clap would suggest for a misspelt name.
pub fn suggest_setting(name: &str) -> Option<String> {
    let error = all_settings_command().try_get_matches_from([format!("--{name}")]).err()?;
    let suggested = error.get(ContextKind::SuggestedArg)?;
    (error.kind() == ErrorKind::UnknownArgument).then(|| suggested.to_string().trim_start_matches('-').to_owned())
}

/// Parses settings like flags.
///
/// # Errors
/// Fails if a flag would reject its value.
pub fn parse_flags(values: &Values) -> Result<ArgMatches, clap::Error> {
    let flags = values.iter().map(|(name, value)| OsString::from(format!("--{name}={value}")));
    all_settings_command().try_get_matches_from(flags)
}

/// Returns the settings that exclude, or are excluded by, one of `names`.
pub fn find_excluded(names: &[String]) -> Vec<String> {
    let every = all_settings_command();
    // clap lists a conflict only on the side that declares it.
    let exclude_each_other = |a: &Arg, b: &Arg| {
        let lists = |from: &Arg, to: &Arg| every.get_arg_conflicts_with(from).iter().any(|x| x.get_id() == to.get_id());
        lists(a, b) || lists(b, a)
    };
    let is_named = |arg: &&Arg| arg.get_long().is_some_and(|long| names.iter().any(|name| name == long));
    let (named, rest): (Vec<&Arg>, Vec<&Arg>) = every.get_arguments().partition(is_named);
    let excluded = rest.into_iter().filter(|arg| named.iter().any(|other| exclude_each_other(arg, other)));
    excluded.filter_map(|arg| arg.get_long().map(str::to_owned)).collect()
}

/// Rewrites each setting of a command and its subcommands, except those that read no settings.
pub fn map_settings(command: Command, rewrite: &dyn Fn(Arg, &str) -> Arg) -> Command {
    let settings = all_settings_command();
    // By id: a command may have an option of the same name that is not a setting.
    rewrite_args(command, &|arg: Arg| match settings.get_arguments().find(|setting| setting.get_id() == arg.get_id()) {
        Some(setting) => rewrite(arg, setting.get_long().unwrap_or_default()),
        None => arg,
    })
}

fn rewrite_args(command: Command, rewrite: &dyn Fn(Arg) -> Arg) -> Command {
    command.mut_args(rewrite).mut_subcommands(|subcommand| match WITHOUT_SETTINGS.contains(&subcommand.get_name()) {
        true => subcommand,
        false => rewrite_args(subcommand, rewrite),
    })
}
