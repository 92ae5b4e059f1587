//! Trusted places, which other users cannot change: paths from the environment, and code to load.

use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use rustix::process::{getegid, geteuid};

/// Everyone may write.
const WRITABLE_BY_ALL: u32 = 0o002;
/// The group may write.
const WRITABLE_BY_GROUP: u32 = 0o020;
/// Sticky bit: in such a folder users can rename and remove only their own files.
const STICKY: u32 = 0o1000;

/// Returns the path in an environment variable; `None` if it is empty or relative, because a relative path would depend
/// on the working directory.
pub fn absolute_env_path(variable: &str) -> Option<PathBuf> {
    std::env::var_os(variable).map(PathBuf::from).filter(|path| path.is_absolute())
}

/// Resolves the path of a code file, and checks that it is trusted.
///
/// # Errors
/// The file does not exist; or users other than this one and root can write to it, or replace it or a folder on its
/// path.
pub fn resolve_code_path(path: &Path) -> Result<PathBuf, String> {
    let there = path.canonicalize().map_err(|error| format!("{}: {error}", path.display()))?;
    let (user, group) = (geteuid().as_raw(), getegid().as_raw());
    for part in there.ancestors() {
        let found = part.metadata().map_err(|error| format!("{}: {error}", part.display()))?;
        if let Some(whose) =
            describe_foreign_write((user, group), (found.uid(), found.gid()), found.mode(), found.is_dir())
        {
            return Err(format!("{} is not loaded, as {} {whose}", path.display(), part.display()));
        }
    }
    Ok(there)
}

/// Returns how users other than `own` (user, group) and root can write to a file of this owner, group and mode; `None`
/// if they cannot.
fn describe_foreign_write(
    own: (u32, u32),
    (owner, group): (u32, u32),
    mode: u32,
    is_folder: bool,
) -> Option<&'static str> {
    let is_sticky = is_folder && mode & STICKY != 0;
    // The own group often may write, if each user has a private group.
    let by_group = mode & WRITABLE_BY_GROUP != 0 && group != own.1 && group != 0;
    match () {
        () if owner != own.0 && owner != 0 => Some("belongs to another user"),
        () if (mode & WRITABLE_BY_ALL != 0 || by_group) && !is_sticky => {
            Some("can be written to by others (chmod go-w)")
        }
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
            assert_eq!(describe_foreign_write(own, whose, mode, is_folder).is_none(), is_fine, "{whose:?} {mode:o}");
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
        assert_eq!(resolve_code_path(&link), Ok(file.canonicalize().unwrap()));
        let open = folder.path().join("open");
        fs::set_permissions(&open, Permissions::from_mode(0o777)).unwrap();
        let why = resolve_code_path(&link).unwrap_err();
        assert!(why.contains("open can be written to by others"), "{why}");
        assert!(resolve_code_path(&folder.path().join("none")).is_err());
    }
}
