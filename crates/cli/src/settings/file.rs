//! The settings file. Which value holds where there are several is up to [`super::layers`].

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use toml::de::{DeTable, DeValue};

use super::paths::counted_from;
use super::table::{Values, is_setting, nearest_setting, parse_flags};
use crate::error::CliError;
use crate::log::{one_line, printable};
use bokehcam::files::input;
use bokehcam::files::trusted::absolute;
use bokehcam::look::{self, SETTINGS, presets};
#[cfg(feature = "window")]
use bokehcam::look::{Patch, presets::Preset};

/// A settings file whose values have been checked.
#[derive(Debug, Default)]
pub struct SettingsFile {
    pub values: Values,
    /// The settings of each preset in it.
    pub presets: BTreeMap<String, Values>,
    /// The file itself; `None` where there is none.
    pub path: Option<PathBuf>,
}

/// The table of the file that the presets are in.
pub const PRESETS: &str = "presets";

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
        let text = input::read_text(&path, input::MOST_SETTINGS_BYTES).map_err(CliError::io(&path))?;
        Self::parse(&path, &text)
    }

    /// Parses the text of the settings file at `path`.
    ///
    /// # Errors
    /// As [`SettingsFile::load`].
    pub fn parse(path: &Path, text: &str) -> Result<Self, CliError> {
        let refuse = |(byte, what): (usize, String)| CliError::Settings {
            path: path.to_owned(),
            line: text[..byte.min(text.len())].matches('\n').count() + 1,
            // It may quote keys and values, which may hold anything.
            what: printable(&what, &[]).into_owned(),
        };
        let keys = DeTable::parse(text).map_err(|error| {
            refuse((error.span().map_or(0, |span| span.start), error.message().replace('\n', ", ")))
        })?;
        let mut file = Self { path: Some(path.to_owned()), ..Self::default() };
        let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let folder = whole.parent().unwrap_or(&whole);
        let (tables, settings): (Vec<_>, Vec<_>) = in_order(keys.get_ref()).partition(|entry| entry.name == PRESETS);
        file.values = checked(settings, &is_setting, folder).map_err(refuse)?;
        for presets in tables {
            let no_table = || refuse((presets.at, "presets are tables: write [presets.NAME]".to_string()));
            for entry in in_order(presets.value.as_table().ok_or_else(no_table)?) {
                let settings = entry.value.as_table().ok_or_else(no_table)?;
                check_name(entry.name).map_err(|what| refuse((entry.at, what)))?;
                let of_a_look = |name: &str| look::settings::setting(name).is_some();
                let values = checked(in_order(settings), &of_a_look, folder).map_err(refuse)?;
                file.presets.insert(entry.name.to_owned(), values);
            }
        }
        if let Some(unknown) = file.values.get("preset").filter(|name| file.preset(name).is_none()) {
            let at = in_order(keys.get_ref()).find(|entry| entry.name == "preset").map_or(0, |entry| entry.at);
            return Err(refuse((at, file.no_preset(unknown))));
        }
        Ok(file)
    }

    /// The settings of a preset, built-in or in this file.
    pub fn preset(&self, name: &str) -> Option<Values> {
        let built_in = presets::built_in().find(|preset| preset.name == name);
        let values = built_in.map(|preset| preset.patch.values());
        let owned =
            |values: Vec<_>| values.into_iter().map(|(name, value): (&str, _)| (name.to_owned(), value)).collect();
        values.map(owned).or_else(|| self.presets.get(name).cloned())
    }

    /// The names of all presets, those in this file last.
    pub fn preset_names(&self) -> Vec<String> {
        let built_in = presets::built_in().map(|preset| preset.name.to_owned());
        built_in.chain(self.presets.keys().cloned()).collect()
    }

    /// All presets, those in this file last. One that cannot be used, such as one whose aperture is a picture that is
    /// gone, is left out with a warning.
    #[cfg(feature = "window")]
    pub fn all_presets(&self) -> Vec<Preset> {
        let of_user = self.presets.iter().filter_map(|(name, values)| {
            let pairs = values.iter().map(|(name, value)| (name.as_str(), value.as_str()));
            // This never fails: the values were checked when the file was read.
            let mut patch = Patch::parse(pairs).ok()?;
            match patch.load() {
                Ok(()) => Some(Preset { name: name.clone(), patch, own: true }),
                Err(error) => {
                    tracing::warn!("preset {name}: {error}");
                    None
                }
            }
        });
        presets::built_in().chain(of_user).collect()
    }

    /// The message that there is no preset of this name, with a list of those there are.
    pub fn no_preset(&self, name: &str) -> String {
        let built_in = presets::built_in().map(|preset| preset.name);
        let all: Vec<String> = built_in.chain(self.presets.keys().cloned()).collect();
        format!("there is no preset '{name}': use {}", all.join(", "))
    }
}

/// Checks the name of a preset that a user defines.
///
/// # Errors
/// It is empty, has control characters, or is that of a built-in preset.
pub fn check_name(name: &str) -> Result<(), String> {
    if name.trim().is_empty() {
        return Err("a preset needs a name".to_string());
    }
    if name.contains(char::is_control) {
        return Err(format!("the name {name:?} of a preset has control characters: leave them out"));
    }
    match presets::built_in().any(|preset| preset.name == name) {
        true => Err(format!("the preset '{name}' is built in: choose another name")),
        false => Ok(()),
    }
}

/// A key of a table with its value.
struct Entry<'a> {
    name: &'a str,
    /// Byte offset of the key in the file.
    at: usize,
    value: &'a DeValue<'a>,
}

/// The keys of a table in the order of the file (the parser sorts them by name), so that the first error is reported.
fn in_order<'a>(table: &'a DeTable<'a>) -> impl Iterator<Item = Entry<'a>> {
    let mut keys: Vec<_> = table.iter().collect();
    keys.sort_unstable_by_key(|(key, _)| key.span().start);
    keys.into_iter().map(|(key, value)| Entry { name: key.get_ref(), at: key.span().start, value: value.get_ref() })
}

/// The values as text, each checked by the parser of its flag, with relative paths counted from `folder`. An error is the
/// byte offset of a key and what is wrong with it.
fn checked<'a>(
    entries: impl IntoIterator<Item = Entry<'a>>,
    allowed: &dyn Fn(&str) -> bool,
    folder: &Path,
) -> Result<Values, (usize, String)> {
    let mut values = Values::new();
    for Entry { name, at, value } in entries {
        if !is_setting(name) {
            let hint = nearest_setting(name).map_or(";".to_owned(), |near| format!(", did you mean {near}?"));
            let what = format!("there is no setting '{name}'{hint} `bokehcam config dump` shows them all");
            return Err((at, what));
        }
        if !allowed(name) {
            return Err((at, format!("'{name}' is not about the look, and a preset is: it can have {}", look_names())));
        }
        let value = match value {
            DeValue::String(text) => text.clone().into_owned(),
            DeValue::Boolean(yes) => yes.to_string(),
            // The flags read decimal numbers alone: none with a prefix such as 0x.
            DeValue::Integer(number) => {
                i64::from_str_radix(number.as_str(), number.radix()).map_or(number.to_string(), |n| n.to_string())
            }
            DeValue::Float(number) => number.as_str().trim_start_matches('+').to_owned(),
            _ => return Err((at, format!("'{name}' must be a text, a number, true or false"))),
        };
        let value = counted_from(folder, name, &value);
        if values.insert(look::settings::name_of(name).to_owned(), value).is_some() {
            return Err((at, format!("'{name}' is there already, by its other name: leave one of them out")));
        }
        // With those before it, so that two settings that exclude each other are found, too.
        parse_flags(&values).map_err(|error| (at, one_line(&error)))?;
    }
    Ok(values)
}

/// The names of a look's settings, as a list for people.
fn look_names() -> String {
    SETTINGS.each_ref().map(|setting| setting.name).join(", ")
}

/// `$XDG_CONFIG_HOME/bokehcam/config.toml`, or the same under `~/.config`.
pub fn user_file() -> Option<PathBuf> {
    Some(folder("XDG_CONFIG_HOME", ".config")?.join("config.toml"))
}

/// The folder for what is remembered and no setting: `$XDG_STATE_HOME/bokehcam`, or the same under `~/.local/state`.
#[cfg(feature = "window")]
pub fn state_folder() -> Option<PathBuf> {
    folder("XDG_STATE_HOME", ".local/state")
}

/// This program's folder in the one that the environment variable names, else in `usual` under the user's home.
fn folder(variable: &str, usual: &str) -> Option<PathBuf> {
    let folder = absolute(variable).or_else(|| Some(absolute("HOME")?.join(usual)))?;
    Some(folder.join("bokehcam"))
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
            ("[presets.mine]\nmirror = true\n", 2, "is not about the look"),
            ("[presets.mine]\npreset = 'portrait'\n", 2, "is not about the look"),
            ("[presets.mine]\nf-number = 2\ncoc-at-infinity = 3\n", 3, "cannot be used with"),
            ("blur = 3\ncoc-at-infinity = 3\n", 2, "is there already"),
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
