//! Browsers of the Chromium family, which list PipeWire's cameras after a change of their settings or with a flag.

use std::env;
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use super::error::CliError;
use bokehcam_files::data::{absolute_env_path, user_dir};
use bokehcam_files::input;

/// The feature to enable, and the flag that enables it alone.
pub const FEATURE: &str = "WebRtcPipeWireCamera";
pub const FLAG: &str = "--enable-features=WebRtcPipeWireCamera";
/// The same as a setting, for one user.
pub const SETTING: &str = "chrome://flags/#enable-webrtc-pipewire-camera";

/// Names, and their start programs.
const PROGRAMS: [(&str, &[&str]); 5] = [
    ("Chromium", &["chromium", "chromium-browser"]),
    ("Chrome", &["google-chrome-stable", "google-chrome"]),
    ("Brave", &["brave", "brave-browser", "brave-browser-stable"]),
    ("Edge", &["microsoft-edge-stable", "microsoft-edge"]),
    ("Vivaldi", &["vivaldi-stable", "vivaldi"]),
];
/// Flatpaks: their names, and their folder and flags file below `~/.var/app`.
const FLATPAKS: [(&str, &str, &str); 3] = [
    ("Chromium's Flatpak", "org.chromium.Chromium", "config/chromium-flags.conf"),
    ("Chrome's Flatpak", "com.google.Chrome", "config/chrome-flags.conf"),
    ("Brave's Flatpak", "com.brave.Browser", "config/brave-flags.conf"),
];
/// End of the names of flags files.
const FILE_ENDING: &str = "-flags.conf";
/// Maximum size of a flags file, and the part of a start program that is searched for its name.
pub const MAX_FILE_BYTES: u64 = 64 * 1024;
const SEARCHED_BYTES: u64 = 256 * 1024;

/// An installed browser.
#[derive(Debug)]
pub struct Browser {
    pub name: &'static str,
    /// The file in the user's home from which it reads flags, and which need not exist; `None` if it reads none.
    pub flags_file: Option<PathBuf>,
}

/// What a flags file enables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Features {
    /// Cameras of PipeWire, with or without others.
    PipeWireCamera,
    Others,
    None,
}

/// Finds the installed browsers of the Chromium family.
pub fn find_browsers() -> Vec<Browser> {
    let native = PROGRAMS.iter().filter_map(|(name, programs)| {
        let program = programs.iter().find_map(|program| find_program(program))?;
        Some(Browser { name, flags_file: find_flags_file(&program) })
    });
    let apps = absolute_env_path("HOME").unwrap_or_default().join(".var/app");
    let is_there = |(_, app, _): &&(&str, &str, &str)| apps.is_absolute() && apps.join(app).is_dir();
    let flatpaks = FLATPAKS.iter().filter(is_there);
    let flatpaks = flatpaks.map(|(name, app, file)| Browser { name, flags_file: Some(apps.join(app).join(file)) });
    native.chain(flatpaks).collect()
}

/// Returns the path of an installed program.
pub fn find_program(name: &str) -> Option<PathBuf> {
    let folders = env::var_os("PATH").unwrap_or_default();
    env::split_paths(&folders).map(|folder| folder.join(name)).find(|path| path.is_file())
}

/// Returns the flags file that a start program names: a script, or the small program of Arch Linux.
fn find_flags_file(program: &Path) -> Option<PathBuf> {
    let mut content = Vec::new();
    File::open(program).ok()?.take(SEARCHED_BYTES).read_to_end(&mut content).ok()?;
    let content = String::from_utf8_lossy(&content);
    let is_name = |word: &&str| word.len() > FILE_ENDING.len() && word.ends_with(FILE_ENDING);
    let name = content.split(|c: char| !c.is_ascii_alphanumeric() && !"-_.".contains(c)).find(is_name)?;
    let variable = if content.contains("XDG_CONFIG_HOME") { "XDG_CONFIG_HOME" } else { "" };
    // Without either, it is a file of the system.
    let is_users = !variable.is_empty() || content.contains(".config");
    Some(user_dir(variable, ".config").filter(|_| is_users)?.join(name))
}

/// Reads what a flags file enables: its last `--enable-features`, as browsers ignore the others.
///
/// # Errors
/// The file exists, but cannot be read as text.
pub fn read_features(file: &Path) -> Result<Features, CliError> {
    let text = read_flags(file)?;
    let lines = text.lines().filter(|line| !line.trim_start().starts_with('#'));
    let mut enabled = lines.flat_map(str::split_whitespace).filter_map(|word| {
        let quotes = ['"', '\''];
        Some(word.trim_matches(quotes).strip_prefix("--enable-features=")?.trim_matches(quotes))
    });
    Ok(match enabled.next_back() {
        None => Features::None,
        Some(enabled) if enabled.split(',').any(|feature| feature == FEATURE) => Features::PipeWireCamera,
        Some(_) => Features::Others,
    })
}

/// Reads a flags file; empty if it does not exist.
///
/// # Errors
/// The file exists, but cannot be read as text.
pub fn read_flags(file: &Path) -> Result<String, CliError> {
    match input::read_text(file, MAX_FILE_BYTES) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(String::new()),
        text => text.map_err(CliError::io(file)),
    }
}

/// Returns a path as people write it, with `~` for their home.
pub fn shorten(path: &Path) -> String {
    let home = absolute_env_path("HOME");
    let below_home = home.as_ref().and_then(|home| path.strip_prefix(home).ok());
    below_home.map_or_else(|| path.display().to_string(), |below| format!("~/{}", below.display()))
}
