//! Folders whose files belong together, such as the pictures of one run.
//!
//! In an empty folder files are written directly, each atomically. With permission to replace, those of a folder that is
//! not empty go to a new one beside it, `NAME.incomplete`, which takes its place once it is complete; so the old folder
//! is never lost, and a killed run leaves both. The list `.bokehcam` in a folder names the files that this program
//! wrote: a folder with any other file is never replaced.

use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::fs::syncfs;

use super::atomic_file::{PartFile, parse_part_name, sync_folder};
use super::{input, lock};

/// The name of the list of our own files.
const LIST_NAME: &str = ".bokehcam";

/// An error in writing a folder.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// The folder is not empty, and nothing may be replaced.
    #[error("the folder {} is not empty; choose another or write into it with --force", path.display())]
    NotEmpty { path: PathBuf },
    /// A file that would be replaced is not ours.
    #[error("{} was not written by bokehcam, so it is not replaced: move it away, or choose another \
             folder", path.display())]
    Foreign { path: PathBuf },
    /// Another run writes the folder.
    #[error("the folder {} is being written by another run: choose another", path.display())]
    Busy { path: PathBuf },
    /// The folder was removed or moved meanwhile.
    #[error("the folder {} was removed or moved meanwhile", path.display())]
    Gone { path: PathBuf },
    /// An operating system error.
    #[error("cannot write {}: {cause}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        cause: io::Error,
    },
}

impl FolderError {
    fn cannot_write(path: &Path) -> impl FnOnce(io::Error) -> Self {
        |cause| Self::Write { path: path.to_owned(), cause }
    }
}

/// Returns whether we have written files into this folder.
pub fn has_file_list(path: &Path) -> bool {
    path.join(LIST_NAME).symlink_metadata().is_ok_and(|list| list.is_file())
}

/// A folder that is being written. Dropping it has the effect of [`Folder::finish_incomplete`].
#[derive(Debug)]
pub struct Folder {
    /// The path without a trailing slash.
    path: PathBuf,
    /// The folder that files are written to: `path`, or the one that replaces it.
    target: PathBuf,
    /// Number of files written so far.
    file_count: u64,
    /// Holds the lock of `target` while it is open.
    lock: File,
    is_finished: bool,
}

impl Folder {
    /// Opens the folder, and creates it if needed.
    ///
    /// # Errors
    /// The folder is not empty and `replace` is not set, or has a file that is not ours; another run writes it, or it
    /// cannot be written.
    pub fn open(path: &Path, replace: bool) -> Result<Self, FolderError> {
        let mut path: PathBuf = path.components().collect();
        create_folder(&path)?;
        if path.file_name().is_none() || path.is_symlink() {
            path = path.canonicalize().map_err(FolderError::cannot_write(&path))?;
        }
        let mut lock = lock_folder(&path)?;
        let mut target = path.clone();
        let mut entries = fs::read_dir(&path).map_err(FolderError::cannot_write(&path))?;
        if !entries.all(|entry| entry.is_ok_and(|entry| entry.file_name() == LIST_NAME)) {
            if !replace {
                return Err(FolderError::NotEmpty { path });
            }
            own_files(&path)?;
            target = create_beside(&path, "incomplete")?;
            lock = lock_folder(&target)?;
        }
        let list = target.join(LIST_NAME);
        // An old list is that of files that are gone.
        let _ = fs::remove_file(&list);
        File::create_new(&list).map_err(FolderError::cannot_write(&list))?;
        Ok(Self { path, target, file_count: 0, lock, is_finished: false })
    }

    /// Starts a file with this name, and creates its subfolder if needed. [`Folder::commit_file`] completes it.
    ///
    /// # Errors
    /// The folder is gone, or cannot be written.
    pub fn create_file(&self, name: &str) -> Result<PartFile, FolderError> {
        self.check_exists()?;
        let path = self.target.join(name);
        if let Some((subfolder, _)) = name.rsplit_once('/') {
            create_folder(&self.target.join(subfolder))?;
        }
        PartFile::create(&path).map_err(FolderError::cannot_write(&path))
    }

    /// Completes a file.
    ///
    /// # Errors
    /// A file with its name has appeared, or it cannot be written; the folder is unchanged.
    pub fn commit_file(&mut self, part: PartFile) -> Result<(), FolderError> {
        let path = part.path().to_owned();
        let name = path.strip_prefix(&self.target).ok().and_then(Path::to_str).unwrap_or_default();
        part.commit_unsynced().map_err(|cause| match cause.kind() {
            ErrorKind::AlreadyExists => FolderError::Foreign { path: path.clone() },
            _ => FolderError::Write { path: path.clone(), cause },
        })?;
        list_file(&self.target, name).inspect_err(|_| {
            // An unlisted file would never be replaced. Report the list's error.
            let _ = fs::remove_file(&path);
        })?;
        self.file_count += 1;
        Ok(())
    }

    /// Ends a complete set of files, which replaces that of an earlier run. Returns the number of old files.
    ///
    /// # Errors
    /// A foreign file has appeared in the old folder, or it cannot be moved: the old folder stays, and the new files are
    /// in `NAME.incomplete`.
    pub fn finish(mut self) -> Result<u64, FolderError> {
        self.check_exists()?;
        self.sync()?;
        self.is_finished = true;
        if self.target != self.path {
            return self.replace_old();
        }
        self.remove_if_empty();
        Ok(0)
    }

    /// Ends an incomplete set of files: the old folder stays, and the new files are in `NAME.incomplete`; returns that
    /// path. If the folder was empty, the new files stay in it.
    ///
    /// # Errors
    /// The folder is gone.
    pub fn finish_incomplete(mut self) -> Result<Option<PathBuf>, FolderError> {
        self.end_incomplete()
    }

    /// Does the work of [`Folder::finish_incomplete`] and [`Drop`].
    fn end_incomplete(&mut self) -> Result<Option<PathBuf>, FolderError> {
        self.is_finished = true;
        self.check_exists()?;
        // Files that cannot be synced are kept as well.
        let _ = self.sync();
        self.remove_if_empty();
        Ok((self.target != self.path && self.file_count > 0).then(|| self.target.clone()))
    }

    /// Moves the old folder away, the new one to its place, and then removes the old one.
    fn replace_old(&self) -> Result<u64, FolderError> {
        let write = || FolderError::cannot_write(&self.path);
        let own = own_files(&self.path)?;
        let permissions = fs::metadata(&self.path).map_err(write())?.permissions();
        fs::set_permissions(&self.target, permissions).map_err(write())?;
        let old = create_beside(&self.path, "replaced")?;
        let moved = fs::rename(&self.path, &old).and_then(|()| {
            fs::rename(&self.target, &self.path).inspect_err(|_| {
                // Report the first error.
                let _ = fs::rename(&old, &self.path);
            })
        });
        if let Err(cause) = moved {
            // Succeeds only if the old folder is in its place.
            let _ = fs::remove_dir(&old);
            return Err(write()(cause));
        }
        sync_folder(&self.path).map_err(write())?;
        remove_own(&old, &own)?;
        Ok(own.count)
    }

    /// Syncs all files at once: a sync after each would take longer than a camera can wait.
    fn sync(&self) -> Result<(), FolderError> {
        syncfs(&self.lock).map_err(|error| FolderError::cannot_write(&self.target)(error.into()))
    }

    fn check_exists(&self) -> Result<(), FolderError> {
        let identity = |folder: fs::Metadata| (folder.dev(), folder.ino());
        let opened = self.lock.metadata().map(identity).map_err(FolderError::cannot_write(&self.target))?;
        // A new folder with the same name is not ours.
        match fs::metadata(&self.target).map(identity) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(FolderError::cannot_write(&self.target)(error)),
            Ok(there) if there == opened => Ok(()),
            _ => Err(FolderError::Gone { path: self.target.clone() }),
        }
    }

    /// Removes what a set without files has: its list, subfolders and, beside an old one, its folder.
    fn remove_if_empty(&self) {
        if self.file_count == 0 && self.target != self.path {
            let _ = fs::remove_dir_all(&self.target);
        } else if self.file_count == 0 {
            let _ = fs::remove_file(self.path.join(LIST_NAME));
        }
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if !self.is_finished
            && let Err(error) = self.end_incomplete()
        {
            tracing::warn!("{error}");
        }
    }
}

/// Adds a file of ours to the list of `folder`.
///
/// # Errors
/// The list cannot be written.
pub fn list_file(folder: &Path, name: &str) -> Result<(), FolderError> {
    let path = folder.join(LIST_NAME);
    let list = File::options().append(true).create(true).open(&path);
    // The line break comes first, so that a name that was truncated by a full disk spoils no other.
    list.and_then(|mut list| list.write_all(format!("\n{name}").as_bytes())).map_err(FolderError::cannot_write(&path))
}

/// What a folder of ours has: paths within it.
#[derive(Default)]
struct OwnFiles {
    /// Listed files, the list itself, and parts of such files.
    files: Vec<PathBuf>,
    /// The folder itself, and its subfolders, each after the one that it is in.
    folders: Vec<PathBuf>,
    /// Number of listed files.
    count: u64,
}

/// Finds the files in a folder and its subfolders. Fails at a file that is not on its list.
fn own_files(path: &Path) -> Result<OwnFiles, FolderError> {
    let list = path.join(LIST_NAME);
    let names = match input::read_text(&list, input::MAX_TEXT_BYTES) {
        Err(error) if error.kind() == ErrorKind::NotFound => String::new(),
        names => names.map_err(FolderError::cannot_write(&list))?,
    };
    let names: HashSet<&str> = names.lines().collect();
    let mut own = OwnFiles { folders: vec![PathBuf::new()], ..OwnFiles::default() };
    let mut next = 0;
    while let Some(folder) = own.folders.get(next).map(|folder| path.join(folder)) {
        next += 1;
        for entry in fs::read_dir(&folder).map_err(FolderError::cannot_write(&folder))? {
            let (file, is_folder) = entry
                .and_then(|entry| Ok((entry.path(), entry.file_type()?.is_dir())))
                .map_err(FolderError::cannot_write(&folder))?;
            let name = file.strip_prefix(path).unwrap_or(&file).to_owned();
            if is_folder {
                own.folders.push(name);
                continue;
            }
            let is_listed = name.to_str().is_some_and(|name| names.contains(name));
            // A video's part is no leftover of a set of pictures.
            let is_leftover = || {
                let of = file.file_name().and_then(parse_part_name).and_then(|of| Path::new(of).extension());
                of.is_some_and(|of| names.iter().any(|name| Path::new(name).extension() == Some(of)))
            };
            if !is_listed && file != list && !is_leftover() {
                return Err(FolderError::Foreign { path: file });
            }
            own.count += u64::from(is_listed);
            own.files.push(name);
        }
    }
    Ok(own)
}

/// Removes the files of `own` from a folder, and the folder if nothing else has appeared in it.
fn remove_own(path: &Path, own: &OwnFiles) -> Result<(), FolderError> {
    own.files.iter().try_for_each(|file| remove(fs::remove_file, path.join(file)))?;
    own.folders.iter().rev().try_for_each(|folder| remove(fs::remove_dir, path.join(folder)))
}

/// Removes a file or an empty folder. One that is gone, or a folder with something in it, is no error.
fn remove(remove: fn(PathBuf) -> io::Result<()>, path: PathBuf) -> Result<(), FolderError> {
    match remove(path.clone()) {
        Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::DirectoryNotEmpty) => Ok(()),
        done => done.map_err(FolderError::cannot_write(&path)),
    }
}

fn lock_folder(path: &Path) -> Result<File, FolderError> {
    lock::lock_folder(path, Duration::ZERO).map_err(|cause| match cause.kind() {
        ErrorKind::WouldBlock => FolderError::Busy { path: path.to_owned() },
        _ => FolderError::Write { path: path.to_owned(), cause },
    })
}

fn create_folder(path: &Path) -> Result<(), FolderError> {
    fs::create_dir_all(path).map_err(|error| {
        // The system reports `exists` or `not a directory`, but not for which part of the path.
        let in_the_way = path.ancestors().find(|part| part.exists() && !part.is_dir());
        let no_folder = || io::Error::new(ErrorKind::NotADirectory, "it is not a folder");
        match in_the_way {
            Some(part) => FolderError::cannot_write(part)(no_folder()),
            None => FolderError::cannot_write(path)(error),
        }
    })
}

/// Creates a folder `NAME.WHAT` beside `path`, or `NAME.WHAT.2` and so on if the name exists.
fn create_beside(path: &Path, what: &str) -> Result<PathBuf, FolderError> {
    let mut number = 1;
    loop {
        let mut name = path.as_os_str().to_owned();
        name.push(if number == 1 { format!(".{what}") } else { format!(".{what}.{number}") });
        match fs::create_dir(&name) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => number += 1,
            made => return made.map_err(FolderError::cannot_write(name.as_ref())).map(|()| name.into()),
        }
    }
}

#[cfg(test)]
mod tests;
