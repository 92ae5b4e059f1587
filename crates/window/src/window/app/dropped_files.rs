//! Files and folders dropped on the window.

use std::path::Path;

use super::App;
use crate::dialog::path_to_name;
use crate::state::Request;

impl App {
    /// Offers a dropped path as a source; only the first of several.
    pub(super) fn on_file_dropped(&mut self, path: &Path) {
        if std::mem::replace(&mut self.has_dropped, true) {
            self.state.note(format!("One source at a time: {} is left out.", path.display()));
            return self.on_input();
        }
        match path_to_name(path) {
            Ok(name) => self.session.send(Request::Offer(name)),
            Err(line) => self.state.note(line),
        }
        self.on_input();
    }
}
