//! Where settings come from: flag > environment > file > default.
//!
//! The parser of the flags is the only one there is. A setting's environment variable and its key in the file are
//! its flag's name, and the file's values become the flags' default values.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Args, Command};
use toml::de::DeTable;

use super::error::CliError;
use super::one_line;
use super::options::Every;

/// The settings file, each value as it would follow its flag.
#[derive(Debug, Default)]
pub struct SettingsFile {
    values: BTreeMap<String, String>,
}

/// One setting, resolved.
#[derive(Debug, PartialEq)]
pub struct Setting {
    /// Its flag without the dashes.
    pub name: String,
    /// Its value as it would follow the flag; none when its default depends on the picture.
    pub value: Option<String>,
    /// Where the value comes from.
    pub origin: String,
    /// What it does.
    pub help: String,
}

/// Gives every setting its environment variable: `BOKEHCAM_` and the flag's name in capitals.
pub fn with_environment(command: Command) -> Command {
    on_settings(command, &|arg, name| {
        arg.env(format!("BOKEHCAM_{}", name.replace('-', "_").to_uppercase())).hide_env(true)
    })
}

impl SettingsFile {
    /// Reads `chosen`, or else the user's file if there is one.
    ///
    /// # Errors
    /// The file cannot be read, is not TOML, has a key that is no setting, or a value that its flag would refuse.
    pub fn load(chosen: Option<&Path>) -> Result<Self, CliError> {
        let path = match (chosen, user_file()) {
            (Some(chosen), _) => chosen.to_owned(),
            (None, Some(user)) if user.is_file() => user,
            _ => return Ok(Self::default()),
        };
        let text = std::fs::read_to_string(&path).map_err(CliError::io(&path))?;
        Self::parse(&path, &text)
    }

    fn parse(path: &Path, text: &str) -> Result<Self, CliError> {
        let refuse = |at: usize, what: String| CliError::Settings {
            path: path.to_owned(),
            line: text[..at.min(text.len())].matches('\n').count() + 1,
            what,
        };
        let not_toml = |error: &toml::de::Error| {
            refuse(error.span().map_or(0, |span| span.start), error.message().replace('\n', ", "))
        };
        let keys = DeTable::parse(text).map_err(|error| not_toml(&error))?;
        let table: toml::Table = text.parse().map_err(|error| not_toml(&error))?;
        let mut keys: Vec<_> = keys.get_ref().keys().map(|key| (key.span().start, key.get_ref().as_ref())).collect();
        keys.sort_unstable();
        let mut values = BTreeMap::new();
        for (at, name) in keys {
            if !is_setting(name) {
                let hint = nearest_setting(name).map_or(String::new(), |near| format!(", did you mean {near}?"));
                return Err(refuse(
                    at,
                    format!("there is no setting '{name}'{hint} `bokehcam config dump` shows them all"),
                ));
            }
            let value = match table.get(name) {
                Some(toml::Value::String(text)) => text.clone(),
                Some(plain @ (toml::Value::Integer(_) | toml::Value::Float(_) | toml::Value::Boolean(_))) => {
                    plain.to_string()
                }
                _ => return Err(refuse(at, format!("'{name}' must be a text, a number, true or false"))),
            };
            values.insert(name.to_owned(), value);
            // With those before it, so that two settings that exclude each other are found, too.
            parse_flags(&values).map_err(|error| refuse(at, one_line(&error)))?;
        }
        Ok(Self { values })
    }

    /// The command with the file's values as defaults, except those that a setting in `given` excludes.
    pub fn as_defaults(&self, command: Command, given: &ArgMatches) -> Command {
        let excluded = excluded_by(given);
        on_settings(command, &|arg, name| match self.values.get(name) {
            Some(value) if !excluded.iter().any(|other| other == name) => arg.default_value(value.clone()),
            _ => arg,
        })
    }

    /// All settings of the command that `given` belongs to, in the order of its help.
    pub fn resolved(&self, given: &ArgMatches) -> Vec<Setting> {
        let excluded = excluded_by(given);
        let describe = |arg: &Arg| {
            let name = arg.get_long()?.to_owned();
            let id = arg.get_id().as_str();
            // A list as it would be written.
            let listed = |values: clap::parser::RawValues| {
                values.map(|value| value.to_string_lossy().into_owned()).collect::<Vec<_>>().join(",")
            };
            let value = given.get_raw(id).map(listed);
            let origin = match given.value_source(id) {
                Some(ValueSource::CommandLine) => "flag".to_string(),
                Some(ValueSource::EnvVariable) => "environment".to_string(),
                _ if self.values.contains_key(&name) && !excluded.contains(&name) => "file".to_string(),
                _ => "default".to_string(),
            };
            let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
            Some(Setting { name, value, origin, help })
        };
        all_settings().get_arguments().filter_map(describe).collect()
    }
}

/// `$XDG_CONFIG_HOME/bokehcam/config.toml`, or the same under `~/.config`.
pub fn user_file() -> Option<PathBuf> {
    Some(folder("XDG_CONFIG_HOME", ".config")?.join("config.toml"))
}

/// What is remembered that is no setting: `$XDG_STATE_HOME/bokehcam`, or the same under `~/.local/state`.
#[cfg(feature = "window")]
pub fn state_folder() -> Option<PathBuf> {
    folder("XDG_STATE_HOME", ".local/state")
}

/// This program's folder in the one that `variable` names, else in `usual` under the user's home.
fn folder(variable: &str, usual: &str) -> Option<PathBuf> {
    let absolute = |name| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let folder = absolute(variable).or_else(|| Some(absolute("HOME")?.join(usual)))?;
    Some(folder.join("bokehcam"))
}

/// A command that has every setting and nothing else.
fn all_settings() -> Command {
    Every::augment_args(Command::new("settings").disable_help_flag(true).no_binary_name(true))
}

fn is_setting(name: &str) -> bool {
    all_settings().get_arguments().any(|arg| arg.get_long() == Some(name))
}

/// The setting whose name clap would suggest.
fn nearest_setting(name: &str) -> Option<String> {
    let error = all_settings().try_get_matches_from([format!("--{name}")]).err()?;
    let suggested = error.get(clap::error::ContextKind::SuggestedArg)?;
    (error.kind() == ErrorKind::UnknownArgument).then(|| suggested.to_string().trim_start_matches('-').to_owned())
}

fn parse_flags(values: &BTreeMap<String, String>) -> Result<ArgMatches, clap::Error> {
    let flags = values.iter().map(|(name, value)| OsString::from(format!("--{name}={value}")));
    all_settings().try_get_matches_from(flags)
}

/// Names of the settings that exclude, or are excluded by, one that a flag or the environment gives.
fn excluded_by(given: &ArgMatches) -> Vec<String> {
    let every = all_settings();
    let is_given = |arg: &&Arg| {
        let id = arg.get_id().as_str();
        given.try_contains_id(id).is_ok_and(|present| present)
            && matches!(given.value_source(id), Some(ValueSource::CommandLine | ValueSource::EnvVariable))
    };
    let exclude_each_other = |a: &Arg, b: &Arg| {
        let names = |from: &Arg, to: &Arg| every.get_arg_conflicts_with(from).iter().any(|x| x.get_id() == to.get_id());
        names(a, b) || names(b, a)
    };
    let (given, rest): (Vec<&Arg>, Vec<&Arg>) = every.get_arguments().partition(is_given);
    let excluded = rest.into_iter().filter(|arg| given.iter().any(|other| exclude_each_other(arg, other)));
    excluded.filter_map(|arg| arg.get_long().map(str::to_owned)).collect()
}

/// Rewrites each setting of a command and of those below it.
fn on_settings(command: Command, rewrite: &dyn Fn(Arg, &str) -> Arg) -> Command {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(text: &str) -> String {
        SettingsFile::parse(Path::new("c.toml"), text).unwrap_err().to_string()
    }

    #[test]
    fn what_is_wrong_in_the_file_is_named_with_its_line() {
        let unknown = refusal("rim = 0.1\n\nrimm = 0.2\n");
        assert!(unknown.starts_with("c.toml:3: there is no setting 'rimm', did you mean rim?"), "{unknown}");
        let value = refusal("# comment\nrim = 2\n");
        assert!(value.starts_with("c.toml:2: ") && value.contains("from 0 to 1"), "{value}");
        assert!(refusal("rim = \n").starts_with("c.toml:1: "));
        assert!(refusal("rim = [1]\n").contains("must be a text, a number"));
        assert!(refusal("[rim]\nx = 1\n").contains("must be a text, a number"));
        let both = refusal("coc-at-infinity = 10\nf-number = 2\n");
        assert!(both.starts_with("c.toml:2: ") && both.contains("--coc-at-infinity"), "{both}");
        for text in [unknown, value, both] {
            assert!(!text.contains('\n'), "{text}");
        }
    }

    #[test]
    fn every_kind_of_value_is_read() {
        let text = "effect = \"dof\"\nrank = 4\nrim = 0.5\nloop = true\nfocus = 2\n";
        let file = SettingsFile::parse(Path::new("c.toml"), text).unwrap();
        assert_eq!(file.values["rim"], "0.5");
        assert_eq!(file.values["loop"], "true");
        assert_eq!(file.values.len(), 5);
    }
}
