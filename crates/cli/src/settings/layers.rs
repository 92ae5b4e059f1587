//! Precedence of settings: flag > snapshot > environment > preset > file > default.
//!
//! Values of a snapshot, preset or file become clap's default values of the flags. A setting also overrides those that
//! it excludes in weaker layers.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::builder::Resettable;
use clap::parser::{RawValues, ValueSource};
use clap::{Arg, ArgMatches, Command};

use super::file::SettingsFile;
use super::paths::absolute_file_in;
use super::table::{Values, WINDOW_STATE, all_settings_command, find_excluded, map_settings, parse_flags};
use crate::error::CliError;
use crate::log::one_line;
use bokehcam::look::{SETTINGS, settings};
use bokehcam_media::recording::snapshot;

/// A setting and its effective value.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Name of its flag, without dashes.
    pub name: String,
    /// Value as written after the flag; `None` if the default depends on the picture.
    pub value: Option<String>,
    /// Layer: flag, environment, snapshot, preset, file or default.
    pub origin: &'static str,
    pub help: String,
}

/// The settings of a command line, for the window and for warnings about unused settings.
#[derive(Clone, Debug, Default)]
pub struct GivenSettings {
    /// Options outside the look that flags and the environment set, as name and value.
    pub switches: Vec<(String, String)>,
    /// Settings of the look that the environment, a snapshot, a preset or the file set: a command without them would
    /// get that value again, so it has to state even a default.
    pub from_layers: Vec<String>,
    /// Settings from flags, environment and preset; from the preset only those that differ from the defaults.
    pub settings: Vec<Setting>,
    /// Names of all settings from flags, environment, preset or file.
    pub stated: Vec<String>,
}

impl GivenSettings {
    /// Whether flags, the environment or a preset set any part of the look.
    pub fn has_look(&self) -> bool {
        let is_look = |name: &str| name == "preset" || settings::find_setting(name).is_some();
        self.settings.iter().any(|setting| is_look(&setting.name))
    }
}

/// The settings of a command line that come from neither flags nor environment.
#[derive(Debug, Default)]
pub struct Layers {
    /// Values and their layers.
    values: BTreeMap<String, (String, &'static str)>,
    /// Settings whose environment variable is ignored, because a stronger layer sets or excludes them.
    ignored: Vec<String>,
}

impl Layers {
    /// Resolves the layers below `given`, the first parse of the command line.
    ///
    /// # Errors
    /// Fails if the chosen preset does not exist, or the chosen snapshot has no settings.
    pub fn resolve(file: &SettingsFile, given: &ArgMatches) -> Result<Self, CliError> {
        let given = innermost_matches(given);
        let names_from = |source: ValueSource| -> Vec<String> {
            let is_from = |arg: &&Arg| value_source_of(given, arg) == Some(source);
            all_settings_command()
                .get_arguments()
                .filter(is_from)
                .filter_map(|arg| arg.get_long().map(str::to_owned))
                .collect()
        };
        let (by_flag, by_environment) = (names_from(ValueSource::CommandLine), names_from(ValueSource::EnvVariable));
        let text_of = |id: &str| given.try_get_one::<String>(id).ok().flatten();
        let preset = match text_of("preset").or_else(|| file.values.get("preset")) {
            Some(name) => file.preset(name).ok_or_else(|| CliError::Usage(file.unknown_preset(name)))?,
            None => Values::new(),
        };
        let snapshot = match given.try_get_one::<PathBuf>("like").ok().flatten() {
            Some(path) => read_snapshot(path)?,
            None => Values::new(),
        };

        // Strongest layer first: later ones add only the settings not in `taken`.
        let mut layers = Self::default();
        let mut taken = by_flag.clone();
        // A preset given as a flag next to a snapshot overrides the snapshot.
        if !snapshot.is_empty() && by_flag.iter().any(|name| name == "preset") {
            layers.add_layer(&preset, "preset", &mut taken);
        }
        layers.add_layer(&snapshot, "snapshot", &mut taken);
        let (ignored, effective) = partition_taken(by_environment, &taken);
        layers.ignored = ignored;
        taken.extend(effective);
        layers.add_layer(&preset, "preset", &mut taken);
        layers.add_layer(&file.values, "file", &mut taken);
        Ok(layers)
    }

    /// Returns the settings of the command line, for composing an equivalent command and for warnings.
    pub fn given_settings(&self, matches: &ArgMatches) -> GivenSettings {
        /// Not repeated in a composed command: they are for one run only, or the window states them itself, like
        /// [`WINDOW_STATE`].
        const NOT_REPEATED: [&str; 4] = ["preset", "report", "force", "mirror"];
        let is_given = |setting: &Setting| {
            let name = setting.name.as_str();
            ["flag", "environment"].contains(&setting.origin)
                && settings::find_setting(name).is_none()
                && !NOT_REPEATED.contains(&name)
                && !WINDOW_STATE.contains(&name)
        };
        let resolved = self.resolve_settings(matches);
        // The composed command does not repeat the `--preset` flag, so its values do not apply there.
        let by_flag = innermost_matches(matches).try_get_one::<String>("preset").ok().flatten().is_some()
            && innermost_matches(matches).value_source("preset") == Some(ValueSource::CommandLine);
        let not_layers = ["flag", "default", if by_flag { "preset" } else { "flag" }];
        let is_from_layers = |setting: &&Setting| {
            settings::find_setting(&setting.name).is_some() && !not_layers.contains(&setting.origin)
        };
        let mut from_layers: Vec<String> =
            resolved.iter().filter(is_from_layers).map(|setting| setting.name.clone()).collect();
        let is_strength = |name: &str| settings::find_setting(name).is_some_and(settings::Setting::sets_strength);
        // The strengths exclude each other: the current one must be stated to override the layers.
        if from_layers.iter().any(|name| is_strength(name)) {
            let all = SETTINGS.iter().filter(|setting| setting.sets_strength());
            from_layers.extend(all.map(|setting| setting.name.to_owned()));
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
        GivenSettings { switches, from_layers, settings, stated }
    }

    /// Adds the values that no stronger layer sets or excludes.
    fn add_layer(&mut self, values: &Values, origin: &'static str, taken: &mut Vec<String>) {
        let (_, free) = partition_taken(values.keys().cloned().collect(), taken);
        self.values.extend(free.iter().map(|name| (name.clone(), (values[name].clone(), origin))));
        taken.extend(free);
    }

    /// Names the settings of the file and of presets that a message mentions, with their place: by their options or by
    /// the files that they name.
    pub fn name_origins(&self, message: &str, options: &[&str], file: &SettingsFile) -> Vec<String> {
        let is_mentioned = |name: &str, value: &str| {
            options.iter().any(|option| settings::resolve_alias(option) == name)
                || absolute_file_in(value).is_some_and(|file| message.contains(file))
        };
        let place = |(name, (value, origin)): (&String, &(String, &str))| {
            let path =
                file.path.as_ref().filter(|_| ["file", "preset"].contains(origin) && is_mentioned(name, value))?;
            let of_preset = if *origin == "preset" { " of the preset" } else { "" };
            Some(format!("{name}{of_preset} in {}", path.display()))
        };
        self.values.iter().filter_map(place).collect()
    }

    /// Sets these values as defaults of the command's flags, and removes the ignored environment variables.
    pub fn apply_defaults(&self, command: Command) -> Command {
        map_settings(command, &|arg, name| {
            let arg = match self.ignored.iter().any(|ignored| ignored == name) {
                true => arg.env(Resettable::Reset),
                false => arg,
            };
            match self.values.get(name) {
                Some((value, _)) => arg.default_value(value.clone()),
                None => arg,
            }
        })
    }

    /// Returns all settings of the command that `given` belongs to, in the order of its help.
    pub fn resolve_settings(&self, given: &ArgMatches) -> Vec<Setting> {
        let given = innermost_matches(given);
        let describe = |arg: &Arg| {
            let name = arg.get_long()?.to_owned();
            // Lists are written with commas.
            let listed = |values: RawValues| {
                values.map(|value| value.to_string_lossy().into_owned()).collect::<Vec<_>>().join(",")
            };
            let value = given.try_get_raw(arg.get_id().as_str()).ok().flatten().map(listed);
            let origin = match value_source_of(given, arg) {
                Some(ValueSource::CommandLine) => "flag",
                Some(ValueSource::EnvVariable) => "environment",
                _ => self.values.get(&name).map_or("default", |(_, origin)| origin),
            };
            let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
            Some(Setting { name, value, origin, help })
        };
        all_settings_command().get_arguments().filter_map(describe).collect()
    }
}

/// Whether a setting has its default value.
fn is_default(setting: &Setting) -> bool {
    let every = all_settings_command();
    let arg = every.get_arguments().find(|arg| arg.get_long() == Some(&setting.name));
    let default = arg.and_then(|arg| arg.get_default_values().first()).map(|value| value.to_string_lossy());
    // Presets write `auto` for a default that depends on the picture, which clap has no value for.
    setting.value.as_deref() == Some(default.as_deref().unwrap_or("auto"))
}

/// Splits `names` into those in `taken` or excluded by it, and the rest.
fn partition_taken(names: Vec<String>, taken: &[String]) -> (Vec<String>, Vec<String>) {
    let excluded = find_excluded(taken);
    names.into_iter().partition(|name| taken.contains(name) || excluded.contains(name))
}

fn value_source_of(given: &ArgMatches, arg: &Arg) -> Option<ValueSource> {
    let id = arg.get_id().as_str();
    given.try_contains_id(id).is_ok_and(|present| present).then(|| given.value_source(id)).flatten()
}

/// Reads the settings of a snapshot, and validates them like flags.
fn read_snapshot(path: &Path) -> Result<Values, CliError> {
    let refuse = |what: String| CliError::Usage(format!("--like {}: {what}", path.display()));
    let written = snapshot::read_settings(path)?.into_iter();
    let values: Values = written.map(|(name, value)| (settings::resolve_alias(&name).to_owned(), value)).collect();
    if let Some(unknown) = values.keys().find(|name| settings::find_setting(name).is_none()) {
        return Err(refuse(format!(
            "its setting '{unknown}' is not a setting of the look: the file is of another version, or was edited"
        )));
    }
    parse_flags(&values).map_err(|error| refuse(one_line(&error)))?;
    Ok(values)
}
/// Returns the matches of the innermost subcommand.
fn innermost_matches(matches: &ArgMatches) -> &ArgMatches {
    matches.subcommand().map_or(matches, |(_, submatches)| innermost_matches(submatches))
}
