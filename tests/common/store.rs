//! A settings store without a file.

use bokehcam::look::{Look, presets::Preset};
use bokehcam_window::services::{CliOption, SettingsStore};

/// Has no presets and saves none; a command lists its own parts.
pub struct NoStore;

impl SettingsStore for NoStore {
    fn presets(&mut self) -> Vec<Preset> {
        Vec::new()
    }
    fn save_preset(&mut self, _: &str, _: &Look) -> Result<(), String> {
        Err("no file".into())
    }
    fn rename_preset(&mut self, _: &str, _: &str) -> Result<(), String> {
        Err("no file".into())
    }
    fn delete_preset(&mut self, _: &str) -> Result<(), String> {
        Err("no file".into())
    }
    fn format_command(&self, _: &Look, source: &str, outputs: &[String], switches: &[CliOption]) -> String {
        format!("show {source} {outputs:?} {switches:?}")
    }
}
