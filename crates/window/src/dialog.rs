//! The desktop's own dialog for a file or a folder: its portal, or `zenity`.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rfd::FileDialog;

use super::services::Browse;
use bokehcam::files::data;

/// Shown where there is no dialog.
const NO_DIALOG: &str = "This desktop has no file dialog (neither a portal nor zenity): drop a folder or a photo on the window, \
                         or start `bokehcam preview FOLDER`.";
/// Nobody cancels a dialog sooner: it never was there.
const AT_ONCE: Duration = Duration::from_millis(250);

/// Asks the person; `None` where they chose nothing. Waits for them.
///
/// # Errors
/// There is no dialog: one line that says what to do instead.
pub fn pick(what: Browse) -> Result<Option<String>, String> {
    if !has_portal() && !has_zenity() {
        return Err(NO_DIALOG.to_owned());
    }
    let began = Instant::now();
    let picked = match what {
        Browse::Folder => FileDialog::new().set_title("Open a recording: its folder").pick_folder(),
        Browse::Photo | Browse::Behind => {
            let title = if what == Browse::Photo { "Open a photo" } else { "A picture behind the subject" };
            let photos = ["png", "jpg", "jpeg", "PNG", "JPG", "JPEG"];
            FileDialog::new().set_title(title).add_filter("Photos", &photos).pick_file()
        }
    };
    match picked {
        Some(path) => name_of(&path).map(Some),
        None if began.elapsed() < AT_ONCE => Err(NO_DIALOG.to_owned()),
        None => Ok(None),
    }
}

/// A path as the name of a source.
///
/// # Errors
/// It is no text.
pub fn name_of(path: &Path) -> Result<String, String> {
    let is_no_text = || format!("{}: its name is no text (UTF-8); rename it to open it here", path.display());
    path.to_str().map(str::to_owned).ok_or_else(is_no_text)
}

/// Whether the desktop offers its dialogs over D-Bus: there is a bus, and somebody to start on it.
fn has_portal() -> bool {
    let is_there =
        |name: &str, file: &str| std::env::var_os(name).is_some_and(|dir| PathBuf::from(dir).join(file).exists());
    let has_bus = std::env::var_os("DBUS_SESSION_BUS_ADDRESS").is_some() || is_there("XDG_RUNTIME_DIR", "bus");
    let service = "dbus-1/services/org.freedesktop.portal.Desktop.service";
    has_bus && data::own().into_iter().chain(data::system()).any(|folder| folder.join(service).exists())
}

fn has_zenity() -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path).any(|dir| dir.join("zenity").is_file())
}
