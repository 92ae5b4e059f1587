//! Which value of a setting holds: flag > snapshot > environment > preset > file > default.
//!
//! What comes from a snapshot, preset or file is given to clap as default values of the flags. A setting also overrides
//! those that it excludes in weaker layers.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::builder::Resettable;
use clap::parser::{RawValues, ValueSource};
use clap::{Arg, ArgMatches, Command};

use super::file::SettingsFile;
use super::paths::file_in;
use super::table::{STATED_BY_WINDOW, Values, all_settings, excluded_by, on_settings, parse_flags};
use crate::error::CliError;
use crate::log::one_line;
use bokehcam::look::{SETTINGS, settings};
use bokehcam::recording::snapshot;

/// A setting with its effective value.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Its flag without the dashes.
    pub name: String,
    /// Its value as it would follow the flag; none when its default depends on the picture.
    pub value: Option<String>,
    /// Its layer: flag, environment, snapshot, preset, file or default.
    pub origin: &'static str,
    pub help: String,
}

/// What a command line gives, as the window and the warnings about unused settings need it.
#[derive(Clone, Debug, Default)]
pub struct Given {
    /// Options besides the look's that flags and the environment set, as name and value.
    #[cfg_attr(not(feature = "window"), expect(dead_code, reason = "the window alone puts commands together"))]
    pub switches: Vec<(String, String)>,
    /// Settings of the look that the environment, a snapshot, a preset or the file set: a command that leaves one out
    /// gets that value again, so it has to state even a default.
    #[cfg_attr(not(feature = "window"), expect(dead_code, reason = "the window alone puts commands together"))]
    pub behind: Vec<String>,
    /// All settings from flags, environment and preset; of the preset only those that differ from the defaults.
    pub settings: Vec<Setting>,
    /// The names of all settings that anything states: flags, environment, preset or file.
    #[cfg_attr(not(feature = "window"), expect(dead_code, reason = "the window alone has a default of its own"))]
    pub stated: Vec<String>,
}

impl Given {
    /// Whether flags or the environment say anything of the look.
    #[cfg(feature = "window")]
    pub fn has_look(&self) -> bool {
        let of_look = |name: &str| name == "preset" || settings::setting(name).is_some();
        self.settings.iter().any(|setting| of_look(&setting.name))
    }
}

/// The settings of one command line that come from neither flags nor environment.
#[derive(Debug, Default)]
pub struct Layers {
    /// Their values, and where those come from.
    values: BTreeMap<String, (String, &'static str)>,
    /// Settings whose environment variable is ignored, as a stronger layer has or excludes them.
    silent: Vec<String>,
}

impl Layers {
    /// Resolves the layers that `given`, the first parse of the command line, knows nothing of.
    ///
    /// # Errors
    /// There is no preset of the name that was chosen, or the snapshot that was named has no settings in it.
    pub fn of(file: &SettingsFile, given: &ArgMatches) -> Result<Self, CliError> {
        let given = leaf(given);
        let names_from = |source: ValueSource| -> Vec<String> {
            let is_from = |arg: &&Arg| source_of(given, arg) == Some(source);
            all_settings().get_arguments().filter(is_from).filter_map(|arg| arg.get_long().map(str::to_owned)).collect()
        };
        let (by_flag, by_environment) = (names_from(ValueSource::CommandLine), names_from(ValueSource::EnvVariable));
        let text_of = |id: &str| given.try_get_one::<String>(id).ok().flatten();
        let preset = match text_of("preset").or_else(|| file.values.get("preset")) {
            Some(name) => file.preset(name).ok_or_else(|| CliError::Usage(file.no_preset(name)))?,
            None => Values::new(),
        };
        let snapshot = match given.try_get_one::<PathBuf>("like").ok().flatten() {
            Some(path) => read_snapshot(path)?,
            None => Values::new(),
        };

        // The strongest layer first: a later one adds only what is not taken yet.
        let mut layers = Self::default();
        let mut taken = by_flag.clone();
        // A preset that was asked for beside a snapshot is meant to change it.
        if !snapshot.is_empty() && by_flag.iter().any(|name| name == "preset") {
            layers.add(&preset, "preset", &mut taken);
        }
        layers.add(&snapshot, "snapshot", &mut taken);
        let (silent, effective) = split_taken(by_environment, &taken);
        layers.silent = silent;
        taken.extend(effective);
        layers.add(&preset, "preset", &mut taken);
        layers.add(&file.values, "file", &mut taken);
        Ok(layers)
    }

    /// What the command line gave, for putting together a command that does the same and for warnings.
    pub fn given(&self, matches: &ArgMatches) -> Given {
        /// Never repeated in a command: they are for one run only, or the window states them itself, as it does
        /// [`STATED_BY_WINDOW`].
        const NOT_REPEATED: [&str; 4] = ["preset", "report", "force", "mirror"];
        let is_given = |setting: &Setting| {
            let name = setting.name.as_str();
            ["flag", "environment"].contains(&setting.origin)
                && settings::setting(name).is_none()
                && !NOT_REPEATED.contains(&name)
                && !STATED_BY_WINDOW.contains(&name)
        };
        let resolved = self.resolved(matches);
        // A preset that a flag names is none of the next command.
        let by_flag = leaf(matches).try_get_one::<String>("preset").ok().flatten().is_some()
            && leaf(matches).value_source("preset") == Some(ValueSource::CommandLine);
        let not_behind = ["flag", "default", if by_flag { "preset" } else { "flag" }];
        let is_behind =
            |setting: &&Setting| settings::setting(&setting.name).is_some() && !not_behind.contains(&setting.origin);
        let mut behind: Vec<String> = resolved.iter().filter(is_behind).map(|setting| setting.name.clone()).collect();
        let of_strength = |name: &str| settings::setting(name).is_some_and(settings::Setting::is_strength);
        // They exclude each other: whichever the look has now must be stated to override the one that is behind.
        if behind.iter().any(|name| of_strength(name)) {
            let all = SETTINGS.iter().filter(|setting| setting.is_strength());
            behind.extend(all.map(|setting| setting.name.to_owned()));
        }
        let is_given_or_preset = |setting: &&Setting| match setting.origin {
            "flag" | "environment" => true,
            "preset" => !is_default(setting),
            _ => false,
        };
        let settings = resolved.iter().filter(is_given_or_preset).cloned().collect();
        let stated = resolved.iter().filter(|setting| setting.origin != "default");
        let stated = stated.map(|setting| setting.name.clone()).collect();
        let given = resolved.into_iter().filter(is_given);
        let switches = given.filter_map(|setting| Some((setting.name, setting.value?))).collect();
        Given { switches, behind, settings, stated }
    }

    /// Adds the values that no stronger layer has or excludes.
    fn add(&mut self, values: &Values, origin: &'static str, taken: &mut Vec<String>) {
        let (_, free) = split_taken(values.keys().cloned().collect(), taken);
        self.values.extend(free.iter().map(|name| (name.clone(), (values[name].clone(), origin))));
        taken.extend(free);
    }

    /// The settings of the file and of presets that a message speaks of, each with where it stands: by their options, where
    /// these are meant, and by the files that they name.
    pub fn behind(&self, message: &str, options: &[&str], file: &SettingsFile) -> Vec<String> {
        let spoken_of = |name: &str, value: &str| {
            options.iter().any(|option| settings::name_of(option) == name)
                || file_in(value).is_some_and(|file| message.contains(file))
        };
        let place = |(name, (value, origin)): (&String, &(String, &str))| {
            let path = file.path.as_ref().filter(|_| ["file", "preset"].contains(origin) && spoken_of(name, value))?;
            let of_preset = if *origin == "preset" { " of the preset" } else { "" };
            Some(format!("{name}{of_preset} in {}", path.display()))
        };
        self.values.iter().filter_map(place).collect()
    }

    /// The command with these values as defaults of its flags, and without the environment variables to ignore.
    pub fn as_defaults(&self, command: Command) -> Command {
        on_settings(command, &|arg, name| {
            let arg = match self.silent.iter().any(|silent| silent == name) {
                true => arg.env(Resettable::Reset),
                false => arg,
            };
            match self.values.get(name) {
                Some((value, _)) => arg.default_value(value.clone()),
                None => arg,
            }
        })
    }

    /// All settings of the command that `given` belongs to, in the order of its help.
    pub fn resolved(&self, given: &ArgMatches) -> Vec<Setting> {
        let given = leaf(given);
        let describe = |arg: &Arg| {
            let name = arg.get_long()?.to_owned();
            // A list as it would be written.
            let listed = |values: RawValues| {
                values.map(|value| value.to_string_lossy().into_owned()).collect::<Vec<_>>().join(",")
            };
            let value = given.try_get_raw(arg.get_id().as_str()).ok().flatten().map(listed);
            let origin = match source_of(given, arg) {
                Some(ValueSource::CommandLine) => "flag",
                Some(ValueSource::EnvVariable) => "environment",
                _ => self.values.get(&name).map_or("default", |(_, origin)| origin),
            };
            let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
            Some(Setting { name, value, origin, help })
        };
        all_settings().get_arguments().filter_map(describe).collect()
    }
}

/// Whether a setting has its default value.
fn is_default(setting: &Setting) -> bool {
    let every = all_settings();
    let arg = every.get_arguments().find(|arg| arg.get_long() == Some(&setting.name));
    let default = arg.and_then(|arg| arg.get_default_values().first()).map(|value| value.to_string_lossy());
    // Presets write `auto` for a default that depends on the picture, of which clap knows nothing.
    setting.value.as_deref() == Some(default.as_deref().unwrap_or("auto"))
}

/// Splits `names` into those that are in `taken` or excluded by it, and the others.
fn split_taken(names: Vec<String>, taken: &[String]) -> (Vec<String>, Vec<String>) {
    let excluded = excluded_by(taken);
    names.into_iter().partition(|name| taken.contains(name) || excluded.contains(name))
}

fn source_of(given: &ArgMatches, arg: &Arg) -> Option<ValueSource> {
    let id = arg.get_id().as_str();
    given.try_contains_id(id).is_ok_and(|present| present).then(|| given.value_source(id)).flatten()
}

/// Reads the settings in a snapshot, and checks them as if they were flags.
fn read_snapshot(path: &Path) -> Result<Values, CliError> {
    let refuse = |what: String| CliError::Usage(format!("--like {}: {what}", path.display()));
    let written = snapshot::settings(path)?.into_iter();
    let values: Values = written.map(|(name, value)| (settings::name_of(&name).to_owned(), value)).collect();
    if let Some(unknown) = values.keys().find(|name| settings::setting(name).is_none()) {
        return Err(refuse(format!(
            "its setting '{unknown}' is none of a look: it is of another version, or was edited"
        )));
    }
    parse_flags(&values).map_err(|error| refuse(one_line(&error)))?;
    Ok(values)
}
/// The matches of the innermost command.
fn leaf(matches: &ArgMatches) -> &ArgMatches {
    matches.subcommand().map_or(matches, |(_, below)| leaf(below))
}
