//! The folder of the sockets: the user's own, and nobody else's.

use std::fs::{self, DirBuilder, File};
use std::io;
use std::io::ErrorKind;
use std::os::unix::fs::{DirBuilderExt, FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;
use rustix::process::geteuid;

use super::{ControlError, Name, socket};
use crate::files::trusted::absolute;

/// How long the lock of the folder is waited for: runs hold it for a moment, while they begin.
const LOCK_PATIENCE: Duration = Duration::from_secs(1);
const TICK: Duration = Duration::from_millis(10);
/// What the names of sockets end with.
const ENDING: &str = ".sock";

/// The folder of the sockets, which need not exist.
///
/// # Errors
/// The user has no runtime folder, or it is not theirs alone.
pub(super) fn path() -> Result<PathBuf, ControlError> {
    let refuse = |what: String| ControlError::NoFolder(what);
    let runtime = absolute("XDG_RUNTIME_DIR")
        .ok_or_else(|| refuse("there is no runtime folder: XDG_RUNTIME_DIR names no whole path".into()))?;
    if !runtime.is_dir() {
        return Err(refuse(format!("there is no runtime folder: XDG_RUNTIME_DIR is {}", runtime.display())));
    }
    let folder = runtime.join("bokehcam");
    match folder.symlink_metadata() {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(folder),
        Err(error) => Err(refuse(format!("{}: {error}", folder.display()))),
        Ok(found) if !found.is_dir() => Err(refuse(format!("{} is no folder", folder.display()))),
        Ok(found) if found.uid() != geteuid().as_raw() => {
            Err(refuse(format!("{} belongs to somebody else", folder.display())))
        }
        Ok(found) if found.mode() & 0o077 != 0 => {
            Err(refuse(format!("{0} is open to others: `chmod 700 {0}`", folder.display())))
        }
        Ok(_) => Ok(folder),
    }
}

/// The folder, made where there is none, and locked against other runs that begin, until the file is dropped.
///
/// # Errors
/// As for [`path`]; or it cannot be made.
pub(super) fn locked() -> Result<(PathBuf, File), ControlError> {
    let folder = path()?;
    let refuse = |error: io::Error| ControlError::NoFolder(format!("{}: {error}", folder.display()));
    match DirBuilder::new().mode(0o700).create(&folder) {
        Err(error) if error.kind() != ErrorKind::AlreadyExists => return Err(refuse(error)),
        _ => {}
    }
    let lock = File::open(&folder).map_err(refuse)?;
    let until = Instant::now() + LOCK_PATIENCE;
    while let Err(error) = flock(&lock, FlockOperation::NonBlockingLockExclusive) {
        if error != Errno::WOULDBLOCK {
            return Err(refuse(error.into()));
        }
        if Instant::now() >= until {
            return Err(ControlError::NoFolder(format!("{} is locked by another program", folder.display())));
        }
        thread::sleep(TICK);
    }
    // It may have been made by somebody else just now.
    path()?;
    Ok((folder.clone(), lock))
}

/// The socket of a name.
pub(super) fn socket_of(folder: &Path, name: &Name) -> PathBuf {
    folder.join(format!("{name}{ENDING}"))
}

/// The names of all sockets of this user's in the folder, sorted.
pub(super) fn names(folder: &Path) -> Vec<Name> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<Name> = entries
        .filter(|entry| is_ours(&entry.path()))
        .filter_map(|entry| entry.file_name().to_str()?.strip_suffix(ENDING)?.parse().ok())
        .collect();
    names.sort_by(|one, other| one.as_str().cmp(other.as_str()));
    names
}

/// Whether this is a socket of this user's.
pub(super) fn is_ours(path: &Path) -> bool {
    path.symlink_metadata().is_ok_and(|found| found.file_type().is_socket() && found.uid() == geteuid().as_raw())
}

/// Removes the sockets of runs that are dead. The folder is locked.
pub(super) fn sweep(folder: &Path) {
    for name in names(folder) {
        let path = socket_of(folder, &name);
        if socket::connect(&path).is_err_and(|error| error.kind() == ErrorKind::ConnectionRefused) {
            tracing::debug!("{}: its run is dead", path.display());
            // One that cannot be removed is in the way at worst.
            let _ = fs::remove_file(&path);
        }
    }
}
