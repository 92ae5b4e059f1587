//! Files and folders that are dropped on the window.

use std::path::Path;

use super::App;
use crate::dialog::name_of;
use crate::state::Request;

impl App {
    /// Offers what was dropped as a source; of several, the first.
    pub(super) fn on_drop(&mut self, path: &Path) {
        if std::mem::replace(&mut self.has_dropped, true) {
            self.state.note(format!("One source at a time: {} is left out.", path.display()));
            return self.on_input();
        }
        match name_of(path) {
            Ok(name) => self.session.order(Request::Offer(name)),
            Err(line) => self.state.note(line),
        }
        self.on_input();
    }
}
