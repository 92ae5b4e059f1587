//! Folders for program data, by the XDG Base Directory Specification. Empty and relative paths are ignored.

use std::env;
use std::path::PathBuf;

use super::trusted::absolute_env_path;

/// Returns the user's folder: `$XDG_DATA_HOME`, or `~/.local/share`.
pub fn user_data_dir() -> Option<PathBuf> {
    absolute_env_path("XDG_DATA_HOME").or_else(|| Some(absolute_env_path("HOME")?.join(".local/share")))
}

/// Returns the system's folders in order of precedence: `$XDG_DATA_DIRS`, or the two standard ones.
pub fn system_data_dirs() -> Vec<PathBuf> {
    let listed = env::var_os("XDG_DATA_DIRS").filter(|dirs| !dirs.is_empty());
    let listed = listed.unwrap_or_else(|| "/usr/local/share:/usr/share".into());
    env::split_paths(&listed).filter(|path| path.is_absolute()).collect()
}
