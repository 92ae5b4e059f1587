//! Default folders and names of snapshots and recordings.

use std::env;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;

use super::data::{absolute_env_path, user_dir};
use super::input;

/// The default folders of snapshots and recordings.
#[derive(Clone, Debug, PartialEq)]
pub struct Folders {
    /// Of snapshots.
    pub pictures: PathBuf,
    /// Of recordings.
    pub videos: PathBuf,
}

/// The prefix of all names, and the suffix of recordings.
const PREFIX: &str = "bokehcam";
const VIDEO_SUFFIX: &str = ".mp4";
/// Date and time between them.
const TIME_FORMAT: &str = "%Y-%m-%d %H-%M-%S";

impl Folders {
    /// Creates folders that are all the same.
    pub fn single(folder: PathBuf) -> Self {
        Self { pictures: folder.clone(), videos: folder }
    }

    /// Returns the user's folders of pictures and videos, from the environment, `user-dirs.dirs` or their default
    /// names; if none exists the home folder, else the current one.
    pub fn from_user_dirs() -> Self {
        let home = absolute_env_path("HOME");
        let config = user_dir("XDG_CONFIG_HOME", ".config");
        let named =
            config.and_then(|config| input::read_text(&config.join("user-dirs.dirs"), input::MAX_SETTINGS_BYTES).ok());
        let folder = |variable: &str, usual: &str| {
            let home = home.as_deref();
            let named = named.as_deref().zip(home).and_then(|(text, home)| parse_user_dir(text, variable, home));
            let usual = home.map(|home| home.join(usual));
            let all = [absolute_env_path(variable), named, usual, home.map(Path::to_owned)];
            all.into_iter()
                .flatten()
                .find(|folder| folder.is_dir())
                .or_else(|| env::current_dir().ok())
                .unwrap_or_default()
        };
        Self { pictures: folder("XDG_PICTURES_DIR", "Pictures"), videos: folder("XDG_VIDEOS_DIR", "Videos") }
    }

    /// Returns both folders, without duplicates: earlier versions put recordings next to snapshots.
    pub fn all(&self) -> impl Iterator<Item = &Path> {
        let pictures = Some(self.pictures.as_path()).filter(|pictures| *pictures != self.videos);
        [self.videos.as_path()].into_iter().chain(pictures)
    }

    /// Returns a path for a new recording, named by date: neither a file nor a link is there, and `is_taken` is false for
    /// it.
    pub fn unused_video_path(&self, is_taken: impl Fn(&Path) -> bool) -> PathBuf {
        let stem = timestamped_stem();
        let path = |number: u32| match number {
            1 => self.videos.join(format!("{stem}{VIDEO_SUFFIX}")),
            _ => self.videos.join(format!("{stem}-{number}{VIDEO_SUFFIX}")),
        };
        let is_free = |path: &PathBuf| path.symlink_metadata().is_err() && !is_taken(path);
        (1..u32::MAX).map(path).find(is_free).unwrap_or_else(|| path(u32::MAX))
    }
}

/// Returns the file name of a new file without extension: the local date and time.
pub fn timestamped_stem() -> String {
    jiff::ZonedDateTime::now().strftime(&format!("{PREFIX} {TIME_FORMAT}")).to_string()
}

/// Returns whether this is a default name of a recording, in the current form or that of earlier versions,
/// `bokehcam-7.mp4`.
pub fn is_recording_name(name: &str) -> bool {
    let Some(rest) = name.strip_prefix(PREFIX).and_then(|rest| rest.strip_suffix(VIDEO_SUFFIX)) else { return false };
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    if let Some(number) = rest.strip_prefix('-') {
        return is_number(number);
    }
    let Some((date, number)) = rest.split_at_checked(" 0000-00-00 00-00-00".len()) else { return false };
    let is_date = jiff::civil::DateTime::strptime(format!(" {TIME_FORMAT}"), date).is_ok();
    is_date && (number.is_empty() || number.strip_prefix('-').is_some_and(is_number))
}

/// Formats a path for users: relative to the home folder (`~/`) if it lies there.
pub fn format_path(path: &Path) -> String {
    match absolute_env_path("HOME").and_then(|home| path.strip_prefix(home).ok().map(Path::to_owned)) {
        Some(inside) => format!("~/{}", inside.display()),
        None => path.display().to_string(),
    }
}

/// Formats an output for users: a virtual camera by its name, a file as [`format_path`].
pub fn format_output(name: &str) -> String {
    if name.starts_with('/') { format_path(Path::new(name)) } else { name.to_owned() }
}

/// Returns the absolute path of the folder of a file; `None` if the file does not exist.
pub fn parent_folder(file: &Path) -> Option<PathBuf> {
    let folder = file.canonicalize().ok().filter(|file| file.is_file())?;
    folder.parent().map(Path::to_owned)
}

/// Opens a folder in the desktop's file manager without waiting. If that fails, calls `on_error` with the reason, on
/// another thread.
pub fn open_in_file_manager(folder: PathBuf, on_error: impl Fn(String) + Send + 'static) {
    let run = move || {
        let mut command = Command::new("xdg-open");
        command.arg(&folder).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        let why = match command.status() {
            Ok(status) if status.success() => return,
            Ok(status) => format!("xdg-open: {status}"),
            Err(error) => format!("xdg-open: {error}"),
        };
        on_error(format!("{} cannot be shown: {why}", folder.display()));
    };
    // If there is no thread, the failure cannot be reported.
    let _ = thread::Builder::new().name("folder".into()).spawn(run);
}

/// Parses a folder from `user-dirs.dirs`: a line of `VARIABLE="$HOME/path"` or `VARIABLE="/path"`. The home folder
/// itself means none.
fn parse_user_dir(text: &str, variable: &str, home: &Path) -> Option<PathBuf> {
    let value = text
        .lines()
        .rev()
        .find_map(|line| line.trim().strip_prefix(variable)?.strip_prefix("=\"")?.strip_suffix('"'))?;
    let mut plain = String::new();
    let mut signs = value.chars();
    while let Some(sign) = signs.next() {
        // A backslash escapes a character with a meaning in a shell.
        plain.extend(if sign == '\\' { signs.next() } else { Some(sign) });
    }
    match plain.strip_prefix("$HOME/") {
        Some(inside) => Some(home.join(inside)).filter(|_| !inside.is_empty()),
        None => Some(PathBuf::from(plain)).filter(|path| path.is_absolute() && path != home),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_users_folders_are_read_as_they_are_written() {
        let text = "# made by xdg-user-dirs-update\nXDG_PICTURES_DIR=\"$HOME/Bilder\"\nXDG_VIDEOS_DIR=\"/data/My \\\"films\\\"\"\n\
                    XDG_MUSIC_DIR=\"$HOME/\"\nXDG_DESKTOP_DIR=Desktop\n";
        let named = |variable| parse_user_dir(text, variable, Path::new("/home/me"));
        assert_eq!(named("XDG_PICTURES_DIR"), Some("/home/me/Bilder".into()));
        assert_eq!(named("XDG_VIDEOS_DIR"), Some("/data/My \"films\"".into()));
        for none in ["XDG_MUSIC_DIR", "XDG_DESKTOP_DIR", "XDG_PICTURES", "XDG_TEMPLATES_DIR"] {
            assert_eq!(named(none), None, "{none}");
        }
    }

    #[test]
    fn names_have_the_date_and_are_known_again() {
        assert!(is_recording_name(&format!("{}.mp4", timestamped_stem())), "{}", timestamped_stem());
        for ours in ["bokehcam 2026-11-23 21-14-05.mp4", "bokehcam 2026-11-23 21-14-05-2.mp4", "bokehcam-12.mp4"] {
            assert!(is_recording_name(ours), "{ours}");
        }
        for others in [
            "holiday.mp4",
            "bokehcam-mine.mp4",
            "bokehcam notes.mp4",
            "bokehcam 2026-11-23 21-14-05é.mp4",
            "bokehcam 2026-11-23 21-14-05.png",
            "bokehcam-.mp4",
            "bokehcam.mp4",
        ] {
            assert!(!is_recording_name(others), "{others}");
        }
    }

    #[test]
    fn a_name_that_is_taken_gets_a_number() {
        let folder = tempfile::tempdir().unwrap();
        let folders = Folders::single(folder.path().to_owned());
        let taken = std::cell::RefCell::new(Vec::<PathBuf>::new());
        for _ in 0..3 {
            let path = folders.unused_video_path(|path| taken.borrow().iter().any(|taken| taken == path));
            std::fs::write(&path, "").unwrap();
            let next = folders.unused_video_path(|path| taken.borrow().iter().any(|taken| taken == path));
            assert!(path != next && is_recording_name(next.file_name().unwrap().to_str().unwrap()), "{next:?}");
            taken.borrow_mut().push(next);
        }
    }
}
