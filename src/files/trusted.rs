//! Places that others cannot have a say in: what the environment names, and what is loaded as code.

use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use rustix::process::{getegid, geteuid};

/// Anybody may write.
const BY_ALL: u32 = 0o002;
/// The group may.
const BY_GROUP: u32 = 0o020;
/// In such a folder everybody renames and removes only what is their own.
const STICKY: u32 = 0o1000;

/// The path that a variable of the environment names. One that is empty or relative names none: it would lead wherever the
/// program happens to be started.
pub fn absolute(variable: &str) -> Option<PathBuf> {
    std::env::var_os(variable).map(PathBuf::from).filter(|path| path.is_absolute())
}

/// Where a file of code really is, with all links on the way resolved.
///
/// # Errors
/// It is not there; or others than the user and the system can write to it, or replace it or a folder that it lies in.
pub fn code(path: &Path) -> Result<PathBuf, String> {
    let there = path.canonicalize().map_err(|error| format!("{}: {error}", path.display()))?;
    let (user, group) = (geteuid().as_raw(), getegid().as_raw());
    for part in there.ancestors() {
        let found = part.metadata().map_err(|error| format!("{}: {error}", part.display()))?;
        if let Some(whose) = others_write((user, group), (found.uid(), found.gid()), found.mode(), found.is_dir()) {
            return Err(format!("{} is not loaded, as {} {whose}", path.display(), part.display()));
        }
    }
    Ok(there)
}

/// Why others than `own` user and group, and the system, can write to what has this owner, group and mode.
fn others_write(own: (u32, u32), (owner, group): (u32, u32), mode: u32, is_folder: bool) -> Option<&'static str> {
    let is_sticky = is_folder && mode & STICKY != 0;
    // Where each user has a group of their own, it commonly may write.
    let by_group = mode & BY_GROUP != 0 && group != own.1 && group != 0;
    match () {
        () if owner != own.0 && owner != 0 => Some("belongs to another user"),
        () if (mode & BY_ALL != 0 || by_group) && !is_sticky => Some("can be written to by others (chmod go-w)"),
        () => None,
    }
}

#[cfg(test)]
mod tests {
    use std::fs::{self, Permissions};
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;

    #[test]
    fn code_is_taken_from_where_only_the_user_and_the_system_write() {
        let own = (1000, 1000);
        for (whose, mode, is_folder, is_fine) in [
            ((1000, 1000), 0o100_644, false, true),
            ((0, 0), 0o100_755, false, true),
            ((1000, 1000), 0o100_664, false, true),
            ((0, 0), 0o041_777, true, true),
            ((1000, 1000), 0o100_646, false, false),
            ((1000, 1000), 0o101_646, false, false),
            ((1000, 100), 0o100_664, false, false),
            ((0, 0), 0o040_777, true, false),
            ((1001, 1000), 0o100_644, false, false),
        ] {
            assert_eq!(others_write(own, whose, mode, is_folder).is_none(), is_fine, "{whose:?} {mode:o}");
        }
    }

    #[test]
    fn every_folder_on_the_way_counts_and_links_are_resolved() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("open/inner");
        fs::create_dir_all(&inner).unwrap();
        let file = inner.join("lib.so");
        fs::write(&file, "").unwrap();
        let link = folder.path().join("link.so");
        symlink(&file, &link).unwrap();
        assert_eq!(code(&link), Ok(file.canonicalize().unwrap()));
        let open = folder.path().join("open");
        fs::set_permissions(&open, Permissions::from_mode(0o777)).unwrap();
        let why = code(&link).unwrap_err();
        assert!(why.contains("open can be written to by others"), "{why}");
        assert!(code(&folder.path().join("none")).is_err());
    }
}
