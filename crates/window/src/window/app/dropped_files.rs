//! Files and folders dropped on the window.

use std::path::Path;

use winit::event_loop::ActiveEventLoop;

use super::App;
use crate::dialog::path_to_name;
use crate::state::Action;

impl App {
    /// Takes a dropped path; only the first of several.
    pub(super) fn on_file_dropped(&mut self, path: &Path, events: &ActiveEventLoop) {
        if std::mem::replace(&mut self.has_dropped, true) {
            self.state.note(format!("One source at a time: {} is left out.", path.display()));
            return self.on_input();
        }
        match path_to_name(path) {
            Ok(name) => self.perform_action(Action::Drop(name), events),
            Err(line) => self.state.note(line),
        }
        self.on_input();
    }
}
