//! The folders for programs' data, as the XDG Base Directory Specification has them. A path that is empty or relative names none.

use std::env;
use std::path::PathBuf;

use super::trusted::absolute;

/// The user's own: `$XDG_DATA_HOME`, or `~/.local/share`.
pub fn own() -> Option<PathBuf> {
    absolute("XDG_DATA_HOME").or_else(|| Some(absolute("HOME")?.join(".local/share")))
}

/// The system's, the first one having precedence: `$XDG_DATA_DIRS`, or the usual two.
pub fn system() -> Vec<PathBuf> {
    let listed = env::var_os("XDG_DATA_DIRS").filter(|dirs| !dirs.is_empty());
    let listed = listed.unwrap_or_else(|| "/usr/local/share:/usr/share".into());
    env::split_paths(&listed).filter(|path| path.is_absolute()).collect()
}
