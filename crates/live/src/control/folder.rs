//! The folder of the sockets, which belongs to the user alone.

use std::fs::{self, DirBuilder, File};
use std::io;
use std::io::ErrorKind;
use std::os::unix::fs::{DirBuilderExt, FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::process::geteuid;

use super::{ControlError, Name, socket};
use bokehcam_files::data::absolute_env_path;
use bokehcam_files::lock::lock_folder;

/// Time limit for the folder's lock, which runs hold briefly while they start.
const LOCK_TIMEOUT: Duration = Duration::from_secs(1);
/// File extension of sockets.
const SOCKET_EXTENSION: &str = ".sock";

/// Returns the folder of the sockets, which may not exist yet.
///
/// # Errors
/// The user has no runtime folder, or the folder is not private to the user.
pub(super) fn socket_folder() -> Result<PathBuf, ControlError> {
    let refuse = |what: String| ControlError::NoFolder(what);
    let runtime = absolute_env_path("XDG_RUNTIME_DIR")
        .ok_or_else(|| refuse("there is no runtime folder: XDG_RUNTIME_DIR is not an absolute path".into()))?;
    if !runtime.is_dir() {
        return Err(refuse(format!(
            "there is no runtime folder: XDG_RUNTIME_DIR is {}, which is not a folder",
            runtime.display()
        )));
    }
    let folder = runtime.join("bokehcam");
    match folder.symlink_metadata() {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(folder),
        Err(error) => Err(refuse(format!("{}: {error}", folder.display()))),
        Ok(found) if !found.is_dir() => Err(refuse(format!("{} is not a folder", folder.display()))),
        Ok(found) if found.uid() != geteuid().as_raw() => {
            Err(refuse(format!("{} belongs to another user", folder.display())))
        }
        Ok(found) if found.mode() & 0o077 != 0 => {
            Err(refuse(format!("{0} is accessible to others: run `chmod 700 {0}`", folder.display())))
        }
        Ok(_) => Ok(folder),
    }
}

/// Creates the folder if it does not exist, and locks it against other starting runs until the file is dropped.
///
/// # Errors
/// Same as for [`socket_folder`]; or the folder cannot be created.
pub(super) fn create_locked() -> Result<(PathBuf, File), ControlError> {
    let folder = socket_folder()?;
    let refuse = |error: io::Error| ControlError::NoFolder(format!("{}: {error}", folder.display()));
    match DirBuilder::new().mode(0o700).create(&folder) {
        Err(error) if error.kind() != ErrorKind::AlreadyExists => return Err(refuse(error)),
        _ => {}
    }
    let lock = lock_folder(&folder, LOCK_TIMEOUT).map_err(refuse)?;
    // Another user may have created it just now.
    socket_folder()?;
    Ok((folder.clone(), lock))
}

/// Returns the path of a run's socket.
pub(super) fn socket_path(folder: &Path, name: &Name) -> PathBuf {
    folder.join(format!("{name}{SOCKET_EXTENSION}"))
}

/// Returns the names of all sockets in the folder that belong to this user, sorted.
pub(super) fn list_names(folder: &Path) -> Vec<Name> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<Name> = entries
        .filter(|entry| is_own_socket(&entry.path()))
        .filter_map(|entry| entry.file_name().to_str()?.strip_suffix(SOCKET_EXTENSION)?.parse().ok())
        .collect();
    names.sort_by(|one, other| one.as_str().cmp(other.as_str()));
    names
}

/// Returns whether the path is a socket of this user.
pub(super) fn is_own_socket(path: &Path) -> bool {
    path.symlink_metadata().is_ok_and(|found| found.file_type().is_socket() && found.uid() == geteuid().as_raw())
}

/// Removes the sockets of dead runs; the folder must be locked.
pub(super) fn remove_dead_sockets(folder: &Path) {
    for name in list_names(folder) {
        let path = socket_path(folder, &name);
        if socket::connect(&path).is_err_and(|error| error.kind() == ErrorKind::ConnectionRefused) {
            tracing::debug!("{}: removed, as its run has ended", path.display());
            // A socket that cannot be removed only blocks its name.
            let _ = fs::remove_file(&path);
        }
    }
}
