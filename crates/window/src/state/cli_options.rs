//! The window's state as command-line options.

use super::{State, ViewMode};
use crate::services::CliOption;
use bokehcam::look::Look;

impl State {
    /// Returns the options that reproduce the window, besides those of the look; defaults are omitted.
    pub fn cli_options(&self) -> Vec<CliOption> {
        let shown = Some(self.shown).filter(|shown| *shown != ViewMode::default());
        let yes = |on: bool| on.then(|| "true".to_owned());
        let cli_options = [
            ("show", shown.map(|shown| shown.to_string())),
            ("split", self.split.map(|at| format!("{at:.3}"))),
            ("mirror", (self.mirror != self.camera.faces_user).then(|| self.mirror.to_string())),
            ("full-screen", yes(self.full_screen)),
            ("panel", (!self.panel).then(|| "false".to_owned())),
            // Without any look setting the saved look would be loaded.
            ("fresh", yes(self.look == Look::default())),
            ("single-keys", (!self.preferences.single_keys).then(|| "false".to_owned())),
            ("text-scale", (self.preferences.text_scale != 1.0).then(|| format!("{:.2}", self.preferences.text_scale))),
        ];
        cli_options.into_iter().filter_map(|(name, value)| Some((name.to_owned(), value?))).collect()
    }
}
