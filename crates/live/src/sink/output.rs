//! The file of a sink: gets its name when it is complete, and is kept under another name if it cannot have it.

use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use super::{Ending, SinkError};
use bokehcam_files::atomic_file::{self, PartFile};
use bokehcam_files::input::find_special_file_kind;

/// A file under construction that holds frames. A file with frames is never removed: if it cannot get its name, it is
/// kept as `NAME.incomplete`.
#[derive(Debug)]
pub(super) struct OutputFile {
    path: PathBuf,
    force: bool,
    /// `None` once it has ended.
    part: Option<PartFile>,
    /// Number of frames in it.
    pub frames: u64,
}

impl OutputFile {
    /// Prepares to write `path`, creating missing parent folders. Unfinished files of a killed run are kept, which is
    /// logged.
    pub(super) fn create(path: &Path, force: bool) -> Result<Self, SinkError> {
        if let Some(what) = find_special_file_kind(path) {
            return Err(SinkError::NoFile { path: path.to_owned(), what });
        }
        if !force && path.symlink_metadata().is_ok() {
            return Err(SinkError::Exists { path: path.to_owned() });
        }
        if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            fs::create_dir_all(folder).map_err(SinkError::write(folder))?;
        }
        atomic_file::keep_leftovers(path).map_err(SinkError::write(path))?;
        let part = PartFile::create(path).map_err(SinkError::write(path))?;
        Ok(Self { path: path.to_owned(), force, part: Some(part), frames: 0 })
    }

    /// The final name.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Whether it was completed, kept or removed.
    pub(super) fn has_ended(&self) -> bool {
        self.part.is_none()
    }

    /// The temporary name.
    pub(super) fn part_path(&self) -> &Path {
        self.part.as_ref().map_or(&self.path, PartFile::part_path)
    }

    pub(super) fn file(&self) -> io::Result<&File> {
        self.part.as_ref().map(PartFile::file).ok_or_else(|| ErrorKind::NotFound.into())
    }

    /// Fails if the file was removed: anything further written to it would be lost.
    pub(super) fn check_exists(&self) -> Result<(), SinkError> {
        match self.part.as_ref().is_some_and(PartFile::is_removed) {
            true => Err(SinkError::Removed { path: self.path.clone() }),
            false => Ok(()),
        }
    }

    /// Continues with a file that has the same frames in a better form.
    pub(super) fn replace_part(&mut self, part: PartFile) {
        // Dropping the old part removes it.
        self.part = Some(part);
    }

    /// Gives the finished file its name, or keeps it under another one. A truncated file replaces nothing.
    pub(super) fn complete(&mut self, ending: Ending) -> Result<(), SinkError> {
        let exists = self.check_exists();
        let Some(mut part) = self.part.take() else { return Ok(()) };
        if let Err(error) = exists {
            return Err(self.keep_if_frames(part, error));
        }
        let replace = self.force && ending == Ending::Complete;
        let Err(cause) = part.try_commit(replace) else { return Ok(()) };
        let is_name_taken = cause.kind() == ErrorKind::AlreadyExists;
        // Only a truncated recording gets here with `force`; keeping the old file is not an error.
        if is_name_taken && self.force {
            let (kept, path) = (keep_part(part), self.path.display());
            tracing::warn!("{path} is unchanged: the new file is incomplete, and {kept}");
            return Ok(());
        }
        let path = self.path.clone();
        let error = if is_name_taken { SinkError::Exists { path } } else { SinkError::Write { path, cause } };
        Err(self.keep_if_frames(part, error))
    }

    /// Ends the file after a write error: keeps its content, and adds its location to the error.
    pub(super) fn fail(&mut self, error: SinkError) -> SinkError {
        match self.part.take() {
            Some(part) => self.keep_if_frames(part, error),
            None => error,
        }
    }

    /// Removes the file.
    pub(super) fn discard(&mut self) {
        self.part = None;
    }

    /// Keeps a part that has frames, and adds its location to the error; removes any other.
    fn keep_if_frames(&self, part: PartFile, error: SinkError) -> SinkError {
        // An encoder may have accepted frames and not written any yet.
        let has_frames = self.frames > 0 && part.file().metadata().is_ok_and(|file| file.len() > 0);
        if !has_frames {
            return error;
        }
        let error = Box::new(error);
        match part.keep_incomplete() {
            Ok(kept) => SinkError::Kept { error, kept },
            Err(cause) => SinkError::Lost { error, cause },
        }
    }
}

impl Drop for OutputFile {
    fn drop(&mut self) {
        if let Some(part) = self.part.take().filter(|_| self.frames > 0) {
            // Done before the log call, whose arguments are not evaluated if the level is disabled.
            let kept = keep_part(part);
            tracing::warn!("{}: the incomplete file {kept}", self.path.display());
        }
    }
}

/// Keeps the part, and returns where as text for a message.
fn keep_part(part: PartFile) -> String {
    match part.keep_incomplete() {
        Ok(kept) => format!("is kept as {}", kept.display()),
        Err(cause) => format!("is lost: {cause}"),
    }
}

/// Keeps the videos that killed runs left unfinished in a folder, each as `NAME.incomplete.mp4`; returns the new names.
/// Ignores videos whose `NAME` does not satisfy `is_ours`, and those that cannot be renamed.
pub fn recover_videos(folder: &Path, is_ours: impl Fn(&str) -> bool) -> Vec<PathBuf> {
    let abandoned = atomic_file::find_all_abandoned(folder).unwrap_or_default().into_iter();
    let ours = abandoned.filter(|(_, name)| name.to_str().is_some_and(&is_ours));
    ours.filter_map(|(part, name)| atomic_file::keep_or_remove_part(&part, &folder.join(name)).ok().flatten()).collect()
}
