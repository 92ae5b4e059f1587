//! Replaces one set of files by another, and recovers from interrupted runs.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::list::{self, List};
use super::{FileSet, FolderError, LIST_NAME, STAGING_NAME};
use crate::files::atomic_file;

/// Fails if the folder has a file of the set that is not on its list, so that another program wrote it.
pub(super) fn refuse_foreign(path: &Path, set: &FileSet) -> Result<(), FolderError> {
    let ours = list::read_names(path)?;
    for subfolder in [""].iter().chain(set.subfolders) {
        let folder = path.join(subfolder);
        match fs::symlink_metadata(&folder) {
            Err(error) if error.kind() == ErrorKind::NotFound => continue,
            Ok(there) if !subfolder.is_empty() && !there.is_dir() => return Err(FolderError::Foreign { path: folder }),
            _ => {}
        }
        for entry in fs::read_dir(&folder).map_err(FolderError::cannot_write(&folder))? {
            let name = entry.map_err(FolderError::cannot_write(&folder))?.file_name();
            let Some(name) = name.to_str() else { continue };
            let name = if subfolder.is_empty() { name.to_owned() } else { format!("{subfolder}/{name}") };
            if (set.contains)(&name) && !ours.contains(&name) {
                return Err(FolderError::Foreign { path: path.join(name) });
            }
        }
    }
    Ok(())
}

/// Recovers from a killed run: keeps its files in [`STAGING_NAME`] as `NAME.incomplete`, and removes partly written
/// files.
pub(super) fn recover_interrupted(path: &Path, set: &FileSet) -> Result<(), FolderError> {
    let part = path.join(STAGING_NAME);
    if is_folder(&part) {
        if list::read_names(&part)?.is_empty() {
            fs::remove_dir_all(&part).map_err(FolderError::cannot_write(&part))?;
        } else {
            let kept = keep_incomplete(&part, path)?;
            tracing::warn!("{}: the unfinished output of an earlier run is kept as {}", path.display(), kept.display());
        }
    }
    for folder in [""].iter().chain(set.subfolders).map(|subfolder| path.join(subfolder)) {
        // If the folder is missing, there is nothing to remove.
        for (part, name) in atomic_file::find_all_abandoned(&folder).unwrap_or_default() {
            let file = folder.join(name);
            let name = file.strip_prefix(path).ok().and_then(Path::to_str);
            if name.is_some_and(|name| (set.contains)(name)) {
                // A single incomplete file of a set is not worth keeping.
                fs::remove_file(&part).map_err(FolderError::cannot_write(&part))?;
            }
        }
    }
    Ok(())
}

/// Moves the files of `part`, all of which are complete, into the folder `path`, replacing old ones with the same name,
/// and removes the other files on the old list; returns the number of old files. Replaces only files on that list.
pub(super) fn replace_files(part: &Path, path: &Path) -> Result<u64, FolderError> {
    let (old, new) = (list::read_names(path)?, list::read_names(part)?);
    let is_foreign = |name: &&String| !old.contains(name) && path.join(name).symlink_metadata().is_ok();
    if let Some(name) = new.iter().find(is_foreign) {
        return Err(FolderError::Foreign { path: path.join(name) });
    }
    // List each file as it is moved, so that after a failure exactly the moved files are ours.
    let mut ours = List::open(path)?;
    let is_old = |name: &String| old.contains(name) && is_file(path, name);
    let gone = old.iter().filter(|name| is_old(name)).count() as u64;
    for name in new.iter() {
        let to = path.join(name);
        if let Some((subfolder, _)) = name.rsplit_once('/') {
            create_subfolder(&path.join(subfolder))?;
        }
        atomic_file::rename(&part.join(name), &to, is_old(name)).map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => FolderError::Foreign { path: to.clone() },
            _ => FolderError::cannot_write(&to)(error),
        })?;
        ours.add(name)?;
    }
    for name in old.iter().filter(|name| !new.contains(name) && is_file(path, name)) {
        let file = path.join(name);
        fs::remove_file(&file).map_err(FolderError::cannot_write(&file))?;
    }
    let list = path.join(LIST_NAME);
    atomic_file::rename(&part.join(LIST_NAME), &list, true).map_err(FolderError::cannot_write(&list))?;
    fs::remove_dir_all(part).map_err(FolderError::cannot_write(part))?;
    for name in old.iter().filter_map(|name| Some(name.rsplit_once('/')?.0)) {
        // Succeeds only if the subfolder is empty.
        let _ = fs::remove_dir(path.join(name));
    }
    atomic_file::sync_folder(&list).map_err(FolderError::cannot_write(path))?;
    Ok(gone)
}

/// Returns whether `name` is a regular file in the folder `path`, reached without links.
fn is_file(path: &Path, name: &str) -> bool {
    let folder_is_own = name.rsplit_once('/').is_none_or(|(subfolder, _)| is_folder(&path.join(subfolder)));
    folder_is_own && fs::symlink_metadata(path.join(name)).is_ok_and(|there| there.is_file())
}

fn is_folder(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok_and(|there| there.is_dir())
}

pub(super) fn create_subfolder(path: &Path) -> Result<(), FolderError> {
    match fs::create_dir(path) {
        Err(error) if error.kind() == ErrorKind::AlreadyExists && is_folder(path) => Ok(()),
        made => made.map_err(FolderError::cannot_write(path)),
    }
}

/// Renames `part` to `NAME.incomplete` next to the folder `path`, or inside it if the parent is another file system or
/// not writable. Returns the new path.
pub(super) fn keep_incomplete(part: &Path, path: &Path) -> Result<PathBuf, FolderError> {
    // Paths such as `..` have no file name.
    let path = if path.file_name().is_some() { path.to_owned() } else { fs::canonicalize(path).unwrap_or(path.into()) };
    let within = path.join(path.file_name().unwrap_or("files".as_ref()));
    let kept = atomic_file::keep_incomplete(part, &path).or_else(|_| atomic_file::keep_incomplete(part, &within));
    kept.map_err(FolderError::cannot_write(part))
}
