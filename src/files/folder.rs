//! Folders whose files belong together, such as the pictures of one run: what was there stays until all of the new is
//! whole.
//!
//! The list [`LIST`] in the folder says which files were written by us, one name a line: others are never touched. Into
//! an empty folder files are written directly, each whole. Otherwise they go into a hidden folder within, [`PART`], and
//! are renamed once all are whole. While it is open the folder is locked.

mod list;
mod replace;

use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use rustix::fs::{FlockOperation, flock, syncfs};

use self::list::List;
pub use self::list::adopt;
use self::replace::{keep, make_subfolder, recover, refuse_foreign, replace};
use super::whole::Part;

/// What the list of our own files is called.
pub const LIST: &str = ".bokehcam";
/// Where files wait that will replace others.
pub const PART: &str = ".bokehcam.part";

/// Why a folder cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// It has something in it, and nothing may be replaced.
    #[error("the folder {} is not empty; choose another or write into it with --force", path.display())]
    NotEmpty { path: PathBuf },
    /// A file has a name that is to be written, and is none of ours.
    #[error("{} was not written by bokehcam, and stays: move it away, or choose another folder", path.display())]
    Foreign { path: PathBuf },
    /// Another program, or this one twice.
    #[error("the folder {} is being written by another run: choose another", path.display())]
    Busy { path: PathBuf },
    /// It was removed or moved away while it was written.
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
    fn write(path: &Path) -> impl FnOnce(io::Error) -> Self {
        |cause| Self::Write { path: path.to_owned(), cause }
    }
}

/// Whether this is a folder that we have written files into.
pub fn is_ours(path: &Path) -> bool {
    path.join(LIST).symlink_metadata().is_ok_and(|list| list.is_file())
}

/// Which files will be written.
pub struct Set<'a> {
    /// Folders within the folder that have files of the set.
    pub subfolders: &'a [&'a str],
    /// Whether the set may have a file of this name, such as `000000.png` or `rgb/000000.png`.
    pub has: &'a dyn Fn(&str) -> bool,
}

/// A folder that is being written. Dropping it is as [`Folder::cut`].
#[derive(Debug)]
pub struct Folder {
    /// Its name without a slash at the end.
    path: PathBuf,
    /// The hidden folder within that files go into, if not into the folder itself.
    staging: Option<PathBuf>,
    list: List,
    /// Keeps others out as long as it is open.
    lock: File,
    ended: bool,
}

impl Folder {
    /// Opens the folder for a set of files, and makes it where it is missing. What runs that were killed left behind in
    /// it is kept as `NAME.incomplete`, which is logged.
    ///
    /// # Errors
    /// It has something in it and `replace` is not set, or has a file of the set that is none of ours; it is being
    /// written, or cannot be.
    pub fn open(path: &Path, replace: bool, set: &Set) -> Result<Self, FolderError> {
        let path: PathBuf = path.components().collect();
        let write = || FolderError::write(&path);
        fs::create_dir_all(&path).map_err(|error| {
            // The system says of it that it exists, or that it is no folder, and not which of all on the way.
            let in_the_way = path.ancestors().find(|part| part.exists() && !part.is_dir());
            let no_folder = || io::Error::new(ErrorKind::NotADirectory, "it is no folder");
            match in_the_way {
                Some(part) => FolderError::write(part)(no_folder()),
                None => FolderError::write(&path)(error),
            }
        })?;
        let lock = File::open(&path).map_err(write())?;
        if flock(&lock, FlockOperation::NonBlockingLockExclusive) == Err(rustix::io::Errno::WOULDBLOCK) {
            return Err(FolderError::Busy { path });
        }
        recover(&path, set)?;
        let mut names = fs::read_dir(&path).map_err(write())?.map(|entry| entry.map(|entry| entry.file_name()));
        let other = names.find(|name| name.as_ref().map_or(true, |name| name != LIST)).transpose().map_err(write())?;
        let staging = match other {
            None => None,
            Some(_) if !replace => return Err(FolderError::NotEmpty { path }),
            Some(_) => {
                refuse_foreign(&path, set)?;
                let part = path.join(PART);
                fs::create_dir(&part).map_err(FolderError::write(&part))?;
                Some(part)
            }
        };
        let list = List::create(staging.as_ref().unwrap_or(&path))?;
        Ok(Self { path, staging, list, lock, ended: false })
    }

    /// The folder's name in the end.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Number of files that were put into it.
    pub fn files(&self) -> u64 {
        self.list.len()
    }

    /// Whether files that were there go when the new ones are whole.
    pub fn replaces(&self) -> bool {
        self.staging.is_some()
    }

    /// Starts the file of this name, whose subfolder is made where it is missing. [`Folder::put`] takes it.
    ///
    /// # Errors
    /// The folder is gone, or cannot be written.
    pub fn begin(&self, name: &str) -> Result<Part, FolderError> {
        self.check_there()?;
        let path = self.target().join(name);
        if let Some((subfolder, _)) = name.rsplit_once('/') {
            make_subfolder(&self.target().join(subfolder))?;
        }
        Part::create(&path).map_err(FolderError::write(&path))
    }

    /// Takes a file that is whole.
    ///
    /// # Errors
    /// Something of its name has appeared, or it cannot be written; the folder is then as it was.
    pub fn put(&mut self, part: Part) -> Result<(), FolderError> {
        let path = part.path().to_owned();
        let name = path.strip_prefix(self.target()).ok().and_then(Path::to_str).unwrap_or_default().to_owned();
        part.commit_unsynced().map_err(|cause| match cause.kind() {
            ErrorKind::AlreadyExists => FolderError::Foreign { path: path.clone() },
            _ => FolderError::Write { path: path.clone(), cause },
        })?;
        self.list.add(&name).inspect_err(|_| {
            // A file that is not on the list would never be replaced; the list's error is the one to report.
            let _ = fs::remove_file(&path);
        })
    }

    /// Ends a complete set of files: they replace those on the list of an earlier run, whose number is given.
    ///
    /// # Errors
    /// Something foreign has appeared, which stays, and what was written is kept as `NAME.incomplete`, as is what could not be
    /// moved.
    pub fn finish(mut self) -> Result<u64, FolderError> {
        self.check_there()?;
        self.sync()?;
        self.ended = true;
        let Some(part) = self.staging.take() else {
            self.remove_empty_list();
            return Ok(0);
        };
        let replaced = replace(&part, &self.path);
        if replaced.is_err() {
            keep(&part, &self.path)?;
        }
        replaced
    }

    /// Ends an incomplete set of files: what was there stays, and the new files are kept as `NAME.incomplete`, whose
    /// path is given. If the folder was empty, the new files stay in it.
    ///
    /// # Errors
    /// They cannot be renamed, and stay in a hidden folder within.
    pub fn cut(mut self) -> Result<Option<PathBuf>, FolderError> {
        self.end()
    }

    /// [`Folder::cut`], also for [`Drop`].
    fn end(&mut self) -> Result<Option<PathBuf>, FolderError> {
        self.ended = true;
        self.check_there()?;
        // Files that cannot be synced are kept as well.
        let _ = self.sync();
        match self.staging.take() {
            Some(part) if self.list.len() > 0 => keep(&part, &self.path).map(Some),
            Some(part) => fs::remove_dir_all(&part).map(|()| None).map_err(FolderError::write(&part)),
            None => {
                self.remove_empty_list();
                Ok(None)
            }
        }
    }

    /// Syncs all files at once: waiting for the disk after each would take longer than a camera waits.
    fn sync(&self) -> Result<(), FolderError> {
        syncfs(&self.lock).map_err(|error| FolderError::write(&self.path)(error.into()))
    }

    fn check_there(&self) -> Result<(), FolderError> {
        let identity = |folder: fs::Metadata| (folder.dev(), folder.ino());
        let opened = self.lock.metadata().map(identity).map_err(FolderError::write(&self.path))?;
        // Another folder of that name is none of ours.
        match fs::metadata(&self.path).map(identity) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(FolderError::write(&self.path)(error)),
            Ok(there) if there == opened => Ok(()),
            _ => Err(FolderError::Gone { path: self.path.clone() }),
        }
    }

    /// The folder that files are written into now.
    fn target(&self) -> &Path {
        self.staging.as_ref().unwrap_or(&self.path)
    }

    fn remove_empty_list(&self) {
        if self.list.len() == 0 {
            let _ = fs::remove_file(self.path.join(LIST));
        }
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if !self.ended
            && let Err(error) = self.end()
        {
            tracing::warn!("{error}");
        }
    }
}

#[cfg(test)]
mod tests;
