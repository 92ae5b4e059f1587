//! A program's folders, by the XDG Base Directory Specification. Empty and relative paths are ignored.

use std::env;
use std::path::PathBuf;

/// Returns the path in an environment variable; `None` if it is empty or relative, because a relative path would depend
/// on the working directory.
pub fn absolute_env_path(variable: &str) -> Option<PathBuf> {
    env::var_os(variable).map(PathBuf::from).filter(|path| path.is_absolute())
}

/// Returns the user's folder: `$XDG_DATA_HOME`, or `~/.local/share`.
pub fn user_data_dir() -> Option<PathBuf> {
    user_dir("XDG_DATA_HOME", ".local/share")
}

/// Returns the folder in an environment variable, else the folder `default` below `$HOME`.
pub fn user_dir(variable: &str, default: &str) -> Option<PathBuf> {
    absolute_env_path(variable).or_else(|| Some(absolute_env_path("HOME")?.join(default)))
}

/// Returns the system's folders in order of precedence: `$XDG_DATA_DIRS`, or the two standard ones.
pub fn system_data_dirs() -> Vec<PathBuf> {
    let listed = env::var_os("XDG_DATA_DIRS").filter(|dirs| !dirs.is_empty());
    let listed = listed.unwrap_or_else(|| "/usr/local/share:/usr/share".into());
    env::split_paths(&listed).filter(|path| path.is_absolute()).collect()
}
