//! The settings file. [`super::layers`] decides which value applies.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use toml::de::{DeTable, DeValue};

use super::paths::resolve_paths;
use super::table::{Values, is_setting, parse_flags, suggest_setting};
use crate::error::CliError;
use crate::log::{escape_controls, one_line};
use bokehcam::look::presets::Preset;
use bokehcam::look::{self, Patch, SETTINGS, presets};
use bokehcam_files::data::user_dir;
use bokehcam_files::input;

/// A settings file with validated values.
#[derive(Debug, Default)]
pub struct SettingsFile {
    pub values: Values,
    /// Settings of each preset of the file.
    pub presets: BTreeMap<String, Values>,
    /// Path of the file, if any.
    pub path: Option<PathBuf>,
}

/// Name of the table of presets.
pub const PRESETS: &str = "presets";

impl SettingsFile {
    /// Reads `chosen`, or else the user's file, if any.
    ///
    /// # Errors
    /// Fails if the file is unreadable, is not TOML, or has an unknown key or a value that its flag would reject.
    pub fn load(chosen: Option<&Path>) -> Result<Self, CliError> {
        let path = match (chosen, user_file()) {
            (Some(chosen), _) => chosen.to_owned(),
            (None, Some(user)) if user.is_file() => user,
            _ => return Ok(Self::default()),
        };
        let text = input::read_text(&path, input::MAX_SETTINGS_BYTES).map_err(CliError::io(&path))?;
        Self::parse(&path, &text)
    }

    /// Parses the text of the settings file at `path`.
    ///
    /// # Errors
    /// Fails like [`SettingsFile::load`].
    pub fn parse(path: &Path, text: &str) -> Result<Self, CliError> {
        let refuse = |(byte, what): (usize, String)| CliError::Settings {
            path: path.to_owned(),
            line: text[..byte.min(text.len())].matches('\n').count() + 1,
            // It may quote keys and values with any characters.
            what: escape_controls(&what, &[]).into_owned(),
        };
        let keys = DeTable::parse(text).map_err(|error| {
            let what = format!(
                "write NAME = VALUE, and text in double quotes (TOML: {})",
                error.message().replace('\n', ", ")
            );
            refuse((error.span().map_or(0, |span| span.start), what))
        })?;
        let mut file = Self { path: Some(path.to_owned()), ..Self::default() };
        let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let folder = whole.parent().unwrap_or(&whole);
        let entries = sorted_entries(keys.get_ref());
        let (tables, settings): (Vec<_>, Vec<_>) = entries.partition(|entry| entry.name == PRESETS);
        file.values = check_values(settings, &is_setting, folder).map_err(refuse)?;
        for presets in tables {
            let no_table = || refuse((presets.at, "presets are tables: write [presets.NAME]".to_string()));
            for entry in sorted_entries(presets.value.as_table().ok_or_else(no_table)?) {
                let settings = entry.value.as_table().ok_or_else(no_table)?;
                check_name(entry.name).map_err(|what| refuse((entry.at, what)))?;
                let is_look_setting = |name: &str| look::settings::find_setting(name).is_some();
                let values = check_values(sorted_entries(settings), &is_look_setting, folder).map_err(refuse)?;
                file.presets.insert(entry.name.to_owned(), values);
            }
        }
        if let Some(unknown) = file.values.get("preset").filter(|name| file.preset(name).is_none()) {
            let at = sorted_entries(keys.get_ref()).find(|entry| entry.name == "preset").map_or(0, |entry| entry.at);
            return Err(refuse((at, file.unknown_preset(unknown))));
        }
        Ok(file)
    }

    /// Returns the settings of a preset, built-in or from this file.
    pub fn preset(&self, name: &str) -> Option<Values> {
        let built_in = presets::built_in_presets().find(|preset| preset.name == name);
        let values = built_in.map(|preset| preset.patch.values());
        let owned =
            |values: Vec<_>| values.into_iter().map(|(name, value): (&str, _)| (name.to_owned(), value)).collect();
        values.map(owned).or_else(|| self.presets.get(name).cloned())
    }

    /// Returns the names of all presets, those of this file last.
    pub fn preset_names(&self) -> Vec<String> {
        let built_in = presets::built_in_presets().map(|preset| preset.name.to_owned());
        built_in.chain(self.presets.keys().cloned()).collect()
    }

    /// Returns all presets, those of this file last. Unusable ones, for example with a missing aperture picture, are
    /// skipped with a warning.
    pub fn all_presets(&self) -> Vec<Preset> {
        let user_presets = self.presets.iter().filter_map(|(name, values)| {
            let pairs = values.iter().map(|(name, value)| (name.as_str(), value.as_str()));
            // Never fails: the values were validated when the file was read.
            let mut patch = Patch::parse(pairs).ok()?;
            match patch.load_pictures() {
                Ok(()) => Some(Preset { name: name.clone(), patch, is_user_defined: true }),
                Err(error) => {
                    tracing::warn!("preset {name}: {error}");
                    None
                }
            }
        });
        presets::built_in_presets().chain(user_presets).collect()
    }

    /// Formats the message for an unknown preset, with a list of the known ones.
    pub fn unknown_preset(&self, name: &str) -> String {
        format!("there is no preset '{name}': use {}", self.preset_names().join(", "))
    }
}

/// Validates the name of a user's preset.
///
/// # Errors
/// Fails if the name is empty, has control characters, or is that of a built-in preset.
pub fn check_name(name: &str) -> Result<(), String> {
    if name.trim().is_empty() {
        return Err("a preset needs a name".to_string());
    }
    if name.contains(char::is_control) {
        return Err(format!("the name {name:?} of a preset has control characters: leave them out"));
    }
    match presets::built_in_presets().any(|preset| preset.name == name) {
        true => Err(format!("the preset '{name}' is built in: choose another name")),
        false => Ok(()),
    }
}

/// A key of a table, and its value.
struct Entry<'a> {
    name: &'a str,
    /// Byte offset of the key in the file.
    at: usize,
    value: &'a DeValue<'a>,
}

/// Returns the keys of a table in file order (the parser sorts them by name), so that the first error is reported.
fn sorted_entries<'a>(table: &'a DeTable<'a>) -> impl Iterator<Item = Entry<'a>> {
    let mut keys: Vec<_> = table.iter().collect();
    keys.sort_unstable_by_key(|(key, _)| key.span().start);
    keys.into_iter().map(|(key, value)| Entry { name: key.get_ref(), at: key.span().start, value: value.get_ref() })
}

/// Converts values to text, validates each by the parser of its flag, and resolves relative paths against `folder`. An
/// error is the byte offset of a key and the fault.
fn check_values<'a>(
    entries: impl IntoIterator<Item = Entry<'a>>,
    allowed: &dyn Fn(&str) -> bool,
    folder: &Path,
) -> Result<Values, (usize, String)> {
    let mut values = Values::new();
    for Entry { name, at, value } in entries {
        if !is_setting(name) {
            let hint = suggest_setting(name).map_or(";".to_owned(), |near| format!(", did you mean {near}?"));
            let what = format!("there is no setting '{name}'{hint} `bokehcam config dump` shows them all");
            return Err((at, what));
        }
        if !allowed(name) {
            return Err((at, format!("'{name}' does not belong to the look: a preset can have {}", look_names())));
        }
        let value = match value {
            DeValue::String(text) => text.clone().into_owned(),
            DeValue::Boolean(yes) => yes.to_string(),
            // Flags accept decimal numbers only, without a prefix such as 0x.
            DeValue::Integer(number) => {
                i64::from_str_radix(number.as_str(), number.radix()).map_or(number.to_string(), |n| n.to_string())
            }
            DeValue::Float(number) => number.as_str().trim_start_matches('+').to_owned(),
            _ => return Err((at, format!("'{name}' must be a text, a number, true or false"))),
        };
        let value = resolve_paths(folder, name, &value);
        if values.insert(look::settings::resolve_alias(name).to_owned(), value).is_some() {
            return Err((at, format!("'{name}' is given twice, also by its other name: leave one of them out")));
        }
        // Validated with the preceding ones, to find settings that exclude each other.
        parse_flags(&values).map_err(|error| (at, one_line(&error)))?;
    }
    Ok(values)
}

/// Returns the names of a look's settings as a comma-separated list.
fn look_names() -> String {
    SETTINGS.each_ref().map(|setting| setting.name).join(", ")
}

/// Returns `$XDG_CONFIG_HOME/bokehcam/config.toml`, or the equivalent under `~/.config`.
pub fn user_file() -> Option<PathBuf> {
    Some(app_folder("XDG_CONFIG_HOME", ".config")?.join("config.toml"))
}

/// Returns the folder for remembered state: `$XDG_STATE_HOME/bokehcam`, or the equivalent under `~/.local/state`.
pub fn state_folder() -> Option<PathBuf> {
    app_folder("XDG_STATE_HOME", ".local/state")
}

/// Returns this program's folder below that of the environment variable, else below `default` in the user's home.
fn app_folder(variable: &str, default: &str) -> Option<PathBuf> {
    Some(user_dir(variable, default)?.join("bokehcam"))
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
        assert!(both.starts_with("c.toml:2: ") && both.contains("--blur"), "{both}");
        let foreign = refusal("\"\\u001b[31mrim\\ri\" = 1\n");
        assert!(foreign.contains("no setting '\\u{1b}[31mrim\\ri';"), "{foreign}");
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
        let numbers =
            SettingsFile::parse(Path::new("c.toml"), "frames = 0x1_0\nhighlights = 1_0.5\nrim = +0.5\n").unwrap();
        assert_eq!(["frames", "highlights", "rim"].map(|name| numbers.values[name].as_str()), ["16", "10.5", "0.5"]);
    }

    #[test]
    fn presets_are_tables_of_settings_of_the_look() {
        let text = "rim = 0.1\npreset = 'mine'\n[presets.mine]\nrim = 0.5\neffect = \"blur\"\n[presets.\"b c\"]\n";
        let file = SettingsFile::parse(Path::new("c.toml"), text).unwrap();
        assert_eq!(file.preset("mine").unwrap()["rim"], "0.5");
        assert_eq!(file.preset("b c").unwrap().len(), 0);
        assert_eq!(file.preset("portrait").unwrap()["aperture"], "disc");
        for (text, line, said) in [
            ("[presets.mine]\n\nrimm = 1\n", 3, "did you mean rim?"),
            ("[presets.mine]\nrim = 2\n", 2, "from 0 to 1"),
            ("[presets.mine]\nmirror = true\n", 2, "does not belong to the look"),
            ("[presets.mine]\npreset = 'portrait'\n", 2, "does not belong to the look"),
            ("[presets.mine]\nf-number = 2\ncoc-at-infinity = 3\n", 3, "cannot be used with"),
            ("blur = 3\ncoc-at-infinity = 3\n", 2, "is given twice"),
            ("[presets.mine.rim]\nx = 1\n", 1, "must be a text, a number"),
            ("rim = 0.1\n[presets.portrait]\nrim = 0.2\n", 2, "is built in"),
            ("[presets.\" \"]\n", 1, "needs a name"),
            ("[presets.\"a\\nb\"]\n", 1, "control characters"),
            ("presets = 3\n", 1, "[presets.NAME]"),
            ("[presets]\nmine = 3\n", 1, "[presets.NAME]"),
            ("rim = 0.1\npreset = 'mina'\n[presets.mine]\n", 2, "no preset 'mina': use portrait, cinematic, dreamy"),
        ] {
            let refused = refusal(text);
            assert!(refused.starts_with(&format!("c.toml:{line}: ")) && refused.contains(said), "{text}: {refused}");
            assert!(!refused.contains('\n'), "{refused}");
        }
    }
}
