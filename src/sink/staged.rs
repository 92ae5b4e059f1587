//! A file that appears under its name only when it is whole.

use std::fs;
use std::path::{Path, PathBuf};

use super::SinkError;

/// The place beside `path` where the file is written. Dropping it removes what was written there.
pub(super) struct Staged {
    path: PathBuf,
    part: PathBuf,
    force: bool,
}

impl Staged {
    /// Prepares to write `path`; missing folders above it are made.
    pub(super) fn new(path: &Path, force: bool) -> Result<Self, SinkError> {
        let mut part_name = std::ffi::OsString::from(".");
        part_name.push(path.file_name().unwrap_or_default());
        part_name.push(".part");
        let staged = Self { path: path.to_owned(), part: path.with_file_name(part_name), force };
        staged.check_free()?;
        if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            fs::create_dir_all(folder).map_err(SinkError::write(folder))?;
        }
        Ok(staged)
    }

    fn check_free(&self) -> Result<(), SinkError> {
        if !self.force && self.path.symlink_metadata().is_ok() {
            return Err(SinkError::Exists { path: self.path.clone() });
        }
        Ok(())
    }

    /// The name in the end.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The name meanwhile.
    pub(super) fn part(&self) -> &Path {
        &self.part
    }

    /// Gives the whole file its name. Looks again whether something has appeared there since the start.
    pub(super) fn commit(self) -> Result<(), SinkError> {
        self.check_free()?;
        fs::rename(&self.part, &self.path).map_err(SinkError::write(&self.path))
    }
}

impl Drop for Staged {
    fn drop(&mut self) {
        // After a commit there is nothing; otherwise nobody is left to tell that it cannot be removed.
        let _ = fs::remove_file(&self.part);
    }
}
