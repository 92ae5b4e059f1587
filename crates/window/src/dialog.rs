//! The desktop's file chooser: the XDG desktop portal, or `zenity`.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rfd::FileDialog;

use super::services::PathKind;
use bokehcam_files::data;

/// Errors shown if the desktop has no file chooser, for a source and for a background.
const NO_DIALOG: &str = "This desktop has no file dialog (no portal, no zenity): drop a folder or a photo on the \
                         window, or start `bokehcam preview FOLDER`.";
const NO_DIALOG_FOR_BACKGROUND: &str = "This desktop has no file dialog (no portal, no zenity): drop a picture or a video on the window and choose “Use as \
     background”, or start with `--behind image:FILE` or `video:FILE`.";
/// Endings of files that can be chosen.
const PHOTOS: [&str; 6] = ["png", "jpg", "jpeg", "PNG", "JPG", "JPEG"];
const VIDEOS: [&str; 10] = ["mp4", "mkv", "webm", "mov", "gif", "MP4", "MKV", "WEBM", "MOV", "GIF"];
/// A dialog that "cancels" within this time was never shown: no user is that fast.
const MIN_DIALOG_TIME: Duration = Duration::from_millis(250);

/// Shows a file chooser and blocks until it closes; `None` if the user cancels.
///
/// # Errors
/// Returns a one-line message with the alternatives if there is no dialog.
pub fn choose_path(kind: PathKind) -> Result<Option<String>, String> {
    let no_dialog = if kind == PathKind::Background { NO_DIALOG_FOR_BACKGROUND } else { NO_DIALOG };
    if !has_portal() && !has_zenity() {
        return Err(no_dialog.to_owned());
    }
    let opened_at = Instant::now();
    let picked = match kind {
        PathKind::Folder => FileDialog::new().set_title("Open a recording: its folder").pick_folder(),
        PathKind::Photo => FileDialog::new().set_title("Open a photo").add_filter("Photos", &PHOTOS).pick_file(),
        PathKind::Background => {
            let files = [&PHOTOS[..], &VIDEOS].concat();
            let dialog = FileDialog::new().set_title("A picture or a video behind the subject");
            dialog.add_filter("Pictures and videos", &files).pick_file()
        }
    };
    match picked {
        Some(path) => path_to_name(&path).map(Some),
        None if opened_at.elapsed() < MIN_DIALOG_TIME => Err(no_dialog.to_owned()),
        None => Ok(None),
    }
}

/// Returns a path as a source name.
///
/// # Errors
/// Fails if the path is not valid UTF-8.
pub fn path_to_name(path: &Path) -> Result<String, String> {
    let not_utf8 = || format!("{}: its name is not UTF-8 text; rename it to open it here", path.display());
    path.to_str().map(str::to_owned).ok_or_else(not_utf8)
}

/// Whether a portal can answer over D-Bus: a session bus exists, and a service file with which it can start the portal.
fn has_portal() -> bool {
    let is_there =
        |name: &str, file: &str| std::env::var_os(name).is_some_and(|dir| PathBuf::from(dir).join(file).exists());
    let has_bus = std::env::var_os("DBUS_SESSION_BUS_ADDRESS").is_some() || is_there("XDG_RUNTIME_DIR", "bus");
    let service = "dbus-1/services/org.freedesktop.portal.Desktop.service";
    has_bus
        && data::user_data_dir().into_iter().chain(data::system_data_dirs()).any(|folder| folder.join(service).exists())
}

fn has_zenity() -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path).any(|dir| dir.join("zenity").is_file())
}
