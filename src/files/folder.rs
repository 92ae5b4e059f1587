//! Folders whose files belong together, such as the pictures of one run: old files stay until all new ones are
//! complete.
//!
//! The list [`LIST_NAME`] in the folder names the files that this program wrote, one per line; other files are never
//! touched. In an empty folder files are written directly, each atomically. Otherwise they are written to a hidden
//! subfolder, [`STAGING_NAME`], and renamed once all are complete. The folder is locked while it is open.

mod list;
mod replace;

use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use rustix::fs::{FlockOperation, flock, syncfs};

use self::list::List;
pub use self::list::adopt_files;
use self::replace::{create_subfolder, keep_incomplete, recover_interrupted, refuse_foreign, replace_files};
use super::atomic_file::PartFile;

/// The name of the list of our own files.
pub const LIST_NAME: &str = ".bokehcam";
/// The hidden subfolder for files that will replace others.
pub const STAGING_NAME: &str = ".bokehcam.part";

/// An error in writing a folder.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// The folder is not empty, and nothing may be replaced.
    #[error("the folder {} is not empty; choose another or write into it with --force", path.display())]
    NotEmpty { path: PathBuf },
    /// A file that would be overwritten is not ours.
    #[error("{} was not written by bokehcam, so it is not replaced: move it away, or choose another \
             folder", path.display())]
    Foreign { path: PathBuf },
    /// Another run writes the folder.
    #[error("the folder {} is being written by another run: choose another", path.display())]
    Busy { path: PathBuf },
    /// The folder was removed or moved meanwhile.
    #[error("the folder {} was removed or moved meanwhile", path.display())]
    Gone { path: PathBuf },
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

/// The files that will be written.
pub struct FileSet<'a> {
    /// Subfolders with files of the set.
    pub subfolders: &'a [&'a str],
    /// Whether a file name may belong to the set, such as `000000.png` or `rgb/000000.png`.
    pub contains: &'a dyn Fn(&str) -> bool,
}

/// A folder that is being written. Dropping it has the effect of [`Folder::finish_incomplete`].
#[derive(Debug)]
pub struct Folder {
    /// The path without a trailing slash.
    path: PathBuf,
    /// The hidden subfolder that files are written to, if not to the folder itself.
    staging: Option<PathBuf>,
    list: List,
    /// Holds the lock while it is open.
    lock: File,
    is_finished: bool,
}

impl Folder {
    /// Opens the folder for a set of files, and creates it if needed. Files of killed runs are kept as
    /// `NAME.incomplete`, which is logged.
    ///
    /// # Errors
    /// The folder is not empty and `replace` is not set, or has a file of the set that is not ours; another run writes
    /// it, or it cannot be written.
    pub fn open(path: &Path, replace: bool, set: &FileSet) -> Result<Self, FolderError> {
        let path: PathBuf = path.components().collect();
        let write = || FolderError::cannot_write(&path);
        fs::create_dir_all(&path).map_err(|error| {
            // The system reports `exists` or `not a directory`, but not for which part of the path.
            let in_the_way = path.ancestors().find(|part| part.exists() && !part.is_dir());
            let no_folder = || io::Error::new(ErrorKind::NotADirectory, "it is not a folder");
            match in_the_way {
                Some(part) => FolderError::cannot_write(part)(no_folder()),
                None => FolderError::cannot_write(&path)(error),
            }
        })?;
        let lock = File::open(&path).map_err(write())?;
        if flock(&lock, FlockOperation::NonBlockingLockExclusive) == Err(rustix::io::Errno::WOULDBLOCK) {
            return Err(FolderError::Busy { path });
        }
        recover_interrupted(&path, set)?;
        let mut names = fs::read_dir(&path).map_err(write())?.map(|entry| entry.map(|entry| entry.file_name()));
        let other =
            names.find(|name| name.as_ref().map_or(true, |name| name != LIST_NAME)).transpose().map_err(write())?;
        let staging = match other {
            None => None,
            Some(_) if !replace => return Err(FolderError::NotEmpty { path }),
            Some(_) => {
                refuse_foreign(&path, set)?;
                let part = path.join(STAGING_NAME);
                fs::create_dir(&part).map_err(FolderError::cannot_write(&part))?;
                Some(part)
            }
        };
        let list = List::create(staging.as_ref().unwrap_or(&path))?;
        Ok(Self { path, staging, list, lock, is_finished: false })
    }

    /// Returns the path of the folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the number of files written so far.
    pub fn file_count(&self) -> u64 {
        self.list.len()
    }

    /// Returns whether old files are replaced once the new ones are complete.
    pub fn is_replacing(&self) -> bool {
        self.staging.is_some()
    }

    /// Starts a file with this name, and creates its subfolder if needed. [`Folder::commit_file`] completes it.
    ///
    /// # Errors
    /// The folder is gone, or cannot be written.
    pub fn create_file(&self, name: &str) -> Result<PartFile, FolderError> {
        self.check_exists()?;
        let path = self.target().join(name);
        if let Some((subfolder, _)) = name.rsplit_once('/') {
            create_subfolder(&self.target().join(subfolder))?;
        }
        PartFile::create(&path).map_err(FolderError::cannot_write(&path))
    }

    /// Completes a file.
    ///
    /// # Errors
    /// A file with its name has appeared, or it cannot be written; the folder is unchanged.
    pub fn commit_file(&mut self, part: PartFile) -> Result<(), FolderError> {
        let path = part.path().to_owned();
        let name = path.strip_prefix(self.target()).ok().and_then(Path::to_str).unwrap_or_default().to_owned();
        part.commit_unsynced().map_err(|cause| match cause.kind() {
            ErrorKind::AlreadyExists => FolderError::Foreign { path: path.clone() },
            _ => FolderError::Write { path: path.clone(), cause },
        })?;
        self.list.add(&name).inspect_err(|_| {
            // An unlisted file would never be replaced. Report the list's error.
            let _ = fs::remove_file(&path);
        })
    }

    /// Ends a complete set of files: it replaces the files on an earlier run's list. Returns their number.
    ///
    /// # Errors
    /// A foreign file has appeared, which stays. The new files, and those that could not be moved, are kept as
    /// `NAME.incomplete`.
    pub fn finish(mut self) -> Result<u64, FolderError> {
        self.check_exists()?;
        self.sync()?;
        self.is_finished = true;
        let Some(part) = self.staging.take() else {
            self.remove_empty_list();
            return Ok(0);
        };
        let replaced = replace_files(&part, &self.path);
        if replaced.is_err() {
            keep_incomplete(&part, &self.path)?;
        }
        replaced
    }

    /// Ends an incomplete set of files: old files stay, and the new ones are kept as `NAME.incomplete`; returns that
    /// path. If the folder was empty, the new files stay in it.
    ///
    /// # Errors
    /// They cannot be renamed, and stay in a hidden subfolder.
    pub fn finish_incomplete(mut self) -> Result<Option<PathBuf>, FolderError> {
        self.end_incomplete()
    }

    /// Does the work of [`Folder::finish_incomplete`] and [`Drop`].
    fn end_incomplete(&mut self) -> Result<Option<PathBuf>, FolderError> {
        self.is_finished = true;
        self.check_exists()?;
        // Files that cannot be synced are kept as well.
        let _ = self.sync();
        match self.staging.take() {
            Some(part) if self.list.len() > 0 => keep_incomplete(&part, &self.path).map(Some),
            Some(part) => fs::remove_dir_all(&part).map(|()| None).map_err(FolderError::cannot_write(&part)),
            None => {
                self.remove_empty_list();
                Ok(None)
            }
        }
    }

    /// Syncs all files at once: a sync after each would take longer than a camera can wait.
    fn sync(&self) -> Result<(), FolderError> {
        syncfs(&self.lock).map_err(|error| FolderError::cannot_write(&self.path)(error.into()))
    }

    fn check_exists(&self) -> Result<(), FolderError> {
        let identity = |folder: fs::Metadata| (folder.dev(), folder.ino());
        let opened = self.lock.metadata().map(identity).map_err(FolderError::cannot_write(&self.path))?;
        // A new folder with the same name is not ours.
        match fs::metadata(&self.path).map(identity) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(FolderError::cannot_write(&self.path)(error)),
            Ok(there) if there == opened => Ok(()),
            _ => Err(FolderError::Gone { path: self.path.clone() }),
        }
    }

    /// Returns the folder that files are written to now.
    fn target(&self) -> &Path {
        self.staging.as_ref().unwrap_or(&self.path)
    }

    fn remove_empty_list(&self) {
        if self.list.len() == 0 {
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

#[cfg(test)]
mod tests;
