//! The settings file as the window's storage of presets.

use std::path::{Path, PathBuf};

use crate::error::CliError;
use crate::settings::command_line;
use crate::settings::file::SettingsFile;
use crate::settings::layers::GivenSettings;
use crate::settings::presets;
use crate::settings::save;
use crate::settings::table::WINDOW_START;
use crate::terminal::print_to_stdout;
use bokehcam::look::Value;
use bokehcam::look::presets::Preset;
use bokehcam::look::{Effect, Look, Patch};
use bokehcam_window::services::{CliOption, SettingsStore};

/// The settings file, and the settings of the command line.
pub(super) struct FileStore {
    /// The settings file chosen by `--config`, if any.
    pub chosen: Option<PathBuf>,
    /// The command line's settings, except those that the window states by itself.
    pub given: GivenSettings,
}

impl FileStore {
    /// Returns the preset that alone, with any focus, makes this look: none if other layers set something.
    fn find_preset(&self, look: &Look) -> Option<Preset> {
        if !self.given.from_layers.is_empty() || self.given.switches.iter().any(|(name, _)| name == "like") {
            return None;
        }
        let all = SettingsFile::load(self.chosen.as_deref()).unwrap_or_default().all_presets();
        all.into_iter().find(|preset| {
            let made = preset.patch.apply_to(&Look::default());
            preset.patch.focus.is_none() && made.is_ok_and(|made| Look { focus: look.focus, ..made } == *look)
        })
    }

    /// Applies `change` to the settings file.
    fn change_file(&self, change: impl FnOnce(&Path) -> Result<(), CliError>) -> Result<(), String> {
        let file = save::file_to_save(self.chosen.as_deref());
        file.and_then(|file| change(&file)).map_err(|error| error.to_string())
    }
}

impl SettingsStore for FileStore {
    fn presets(&mut self) -> Vec<Preset> {
        let file = SettingsFile::load(self.chosen.as_deref()).unwrap_or_else(|error| {
            tracing::warn!("{error}");
            SettingsFile::default()
        });
        file.all_presets()
    }

    fn save_preset(&mut self, name: &str, look: &Look) -> Result<(), String> {
        self.change_file(|file| presets::save(file, name, &Patch::from_look(look).values()))
    }

    fn rename_preset(&mut self, name: &str, new: &str) -> Result<(), String> {
        self.change_file(|file| presets::rename(file, name, new))
    }

    fn delete_preset(&mut self, name: &str) -> Result<(), String> {
        self.change_file(|file| presets::delete(file, name))
    }

    fn format_command(&self, look: &Look, source: &str, outputs: &[String], switches: &[CliOption]) -> String {
        let mut switches = switches.to_vec();
        let is_new = |(name, _): &&CliOption| !switches.iter().any(|(other, _)| other == name);
        // A command with outputs is a `stream`, which has no window.
        let has_effect = |(name, _): &&CliOption| outputs.is_empty() || !WINDOW_START.contains(&name.as_str());
        let given: Vec<CliOption> = self.given.switches.iter().filter(is_new).filter(has_effect).cloned().collect();
        // The window's own switches override those of the command line; camera controls come last.
        let at = switches.iter().position(|(name, _)| name == "control").unwrap_or(switches.len());
        switches.splice(at..at, given);
        let preset = self.find_preset(look);
        let changed = Patch::from_look(look).without_equal_values(&Patch::from_look(&Look::default())).values();
        // Defaults are left out, unless another layer (see `GivenSettings::from_layers`) would override them.
        let is_layered = |name: &str| self.given.from_layers.iter().any(|other| other == name);
        let is_stated = |value: &Value| changed.contains(value) || is_layered(value.0);
        let has_effect = |value: &Value| value.0 != "tilt" || look.effect == Effect::TiltShift;
        let all = Patch::from_look(look).values().into_iter();
        let flags: Vec<Value> = match preset {
            None => all.filter(is_stated).filter(has_effect).collect(),
            Some(Preset { name, patch, .. }) => {
                switches.retain(|(name, _)| name != "fresh");
                let by_preset: Vec<&str> = patch.values().into_iter().map(|(name, _)| name).collect();
                let is_own = |value: &Value| changed.contains(value) && !by_preset.contains(&value.0);
                let is_own = |value: &Value| value.0 == "focus" && is_own(value);
                [("preset", name)].into_iter().chain(all.filter(is_own)).collect()
            }
        };
        let command = command_line::shell_command(source, outputs, &flags, &switches);
        // A closed standard output is no failure.
        let _ = print_to_stdout(format!("{command}\n").as_bytes());
        command
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bokehcam::depth::focus::FocusRule;
    use bokehcam::look::Tilt;

    #[test]
    fn a_look_of_a_preset_is_named_and_what_has_no_effect_is_left_out() {
        let store = FileStore { chosen: None, given: GivenSettings::default() };
        let presets = SettingsFile::default().all_presets();
        for preset in &presets {
            let made = preset.patch.apply_to(&Look::default()).unwrap();
            let focus = FocusRule::Point { x: 0.25, y: 0.5 };
            let fresh = [("fresh".to_owned(), "true".to_owned())];
            let command = store.format_command(&Look { focus, ..made.clone() }, "demo", &[], &fresh);
            assert!(command.contains("--preset") && command.contains("--focus 0.25,0.5"), "{command}");
            assert!(!command.contains("--fresh") && !command.contains("--effect"), "{command}");
            let other = Look { rim: 0.77, tilt: Tilt { band: 0.3, ..made.tilt }, ..made };
            let command = store.format_command(&other, "demo", &[], &[]);
            assert!(command.contains("--rim 0.77") && !command.contains("--preset"), "{command}");
            assert_eq!(command.contains("--tilt"), other.effect == Effect::TiltShift, "{command}");
        }
    }

    #[test]
    fn a_command_has_what_was_given_to_a_window_only_where_there_is_one() {
        let given = |name: &str, value: &str| (name.to_owned(), value.to_owned());
        let switches =
            vec![given("theme", "light"), given("language", "de"), given("save-to", "."), given("fps", "15")];
        let store = FileStore { chosen: None, given: GivenSettings { switches, ..GivenSettings::default() } };
        let command = |outputs: &[String]| store.format_command(&Look::default(), "demo", outputs, &[]);
        let window = command(&[]);
        for switch in ["--theme=light", "--language=de", "--save-to=.", "--fps=15"] {
            assert!(window.contains(switch), "{switch} is not in {window}");
        }
        let stream = command(&["/dev/video9".to_owned()]);
        assert!(stream.starts_with("bokehcam stream") && stream.contains("--fps=15"), "{stream}");
        for switch in ["--theme", "--language", "--save-to"] {
            assert!(!stream.contains(switch), "{switch} is in {stream}");
        }
    }
}
