//! Settings by name: a setting's environment variable and its key in the settings file follow from the name of its
//! flag, and all three are parsed by the flag's parser.

use std::collections::BTreeMap;
use std::ffi::OsString;

use clap::error::{ContextKind, ErrorKind};
use clap::{Arg, ArgMatches, Args, Command};

use crate::options::Every;
use bokehcam::look::settings;

/// Settings by their flags without the dashes, each value as it would follow its flag.
pub type Values = BTreeMap<String, String>;

/// What the variables of settings begin with.
pub const PREFIX: &str = "BOKEHCAM_";

/// Settings of the window alone that it states itself in the commands that it puts together: they may have changed since.
pub const STATED_BY_WINDOW: [&str; 8] =
    ["show", "split", "full-screen", "instruments", "panel", "text-scale", "single-keys", "fresh"];
/// The others of the window alone, which stay as they were given.
pub const GIVEN_TO_WINDOW: [&str; 3] = ["language", "theme", "save-to"];

/// The variable of a setting: `BOKEHCAM_` and the flag's name in capitals.
pub fn variable(setting: &str) -> String {
    format!("{PREFIX}{}", setting.replace('-', "_").to_uppercase())
}

/// The variable that a setting has its value from: by its other name, if that alone is there.
pub fn given_variable(setting: &str) -> String {
    let is_there = |variable: &String| std::env::var_os(variable).is_some_and(|value| !value.is_empty());
    let by_name = variable(setting);
    let other = settings::setting(setting).and_then(settings::Setting::alias).map(variable).filter(is_there);
    if is_there(&by_name) { by_name } else { other.unwrap_or(by_name) }
}

/// Gives every setting its environment variable.
pub fn with_environment(command: Command) -> Command {
    on_settings(command, &|arg, name| arg.env(given_variable(name)).hide_env(true))
}

/// A command that has every setting and nothing else.
pub fn all_settings() -> Command {
    Every::augment_args(Command::new("settings").disable_help_flag(true).no_binary_name(true))
}

/// Whether there is a setting of this name.
pub fn is_setting(name: &str) -> bool {
    all_settings().get_arguments().any(|arg| arg.get_long() == Some(settings::name_of(name)))
}

/// The setting whose name clap would suggest.
pub fn nearest_setting(name: &str) -> Option<String> {
    nearest_in(all_settings(), name)
}

/// The option of a command whose name clap would suggest.
pub fn nearest_in(command: Command, name: &str) -> Option<String> {
    let error = command.try_get_matches_from([format!("--{name}")]).err()?;
    let suggested = error.get(ContextKind::SuggestedArg)?;
    (error.kind() == ErrorKind::UnknownArgument).then(|| suggested.to_string().trim_start_matches('-').to_owned())
}

/// Parses settings as if they were flags.
///
/// # Errors
/// One of them would be refused.
pub fn parse_flags(values: &Values) -> Result<ArgMatches, clap::Error> {
    let flags = values.iter().map(|(name, value)| OsString::from(format!("--{name}={value}")));
    all_settings().try_get_matches_from(flags)
}

/// Names of the settings that exclude, or are excluded by, one of `names`.
pub fn excluded_by(names: &[String]) -> Vec<String> {
    let every = all_settings();
    // clap knows a conflict from the side that declares it.
    let exclude_each_other = |a: &Arg, b: &Arg| {
        let lists = |from: &Arg, to: &Arg| every.get_arg_conflicts_with(from).iter().any(|x| x.get_id() == to.get_id());
        lists(a, b) || lists(b, a)
    };
    let is_named = |arg: &&Arg| arg.get_long().is_some_and(|long| names.iter().any(|name| name == long));
    let (named, rest): (Vec<&Arg>, Vec<&Arg>) = every.get_arguments().partition(is_named);
    let excluded = rest.into_iter().filter(|arg| named.iter().any(|other| exclude_each_other(arg, other)));
    excluded.filter_map(|arg| arg.get_long().map(str::to_owned)).collect()
}

/// Rewrites each setting of a command and of those below it.
pub fn on_settings(command: Command, rewrite: &dyn Fn(Arg, &str) -> Arg) -> Command {
    let settings = all_settings();
    // By id: a command may have an option of the same name that is no setting.
    rewrite_args(command, &|arg: Arg| match settings.get_arguments().find(|setting| setting.get_id() == arg.get_id()) {
        Some(setting) => rewrite(arg, setting.get_long().unwrap_or_default()),
        None => arg,
    })
}

fn rewrite_args(command: Command, rewrite: &dyn Fn(Arg) -> Arg) -> Command {
    command.mut_args(rewrite).mut_subcommands(|below| rewrite_args(below, rewrite))
}
