//! A list that grows during a recording and is renamed to its final name at the end.

use std::fs::OpenOptions;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use crate::recording::error::RecordingError;
use crate::recording::list::{split_lines, whole_lines};
use bokehcam_files::atomic_file::{self, PartFile};
use bokehcam_files::folder::{Folder, list_file};
use bokehcam_files::input;

/// A list under construction. Each line is written at once, so that it survives if the process is killed.
pub(super) struct GrowingList {
    part: PartFile,
    /// Length of all complete lines, in bytes.
    bytes: u64,
    /// Length without the last line.
    bytes_before_last: u64,
}

impl GrowingList {
    /// Creates a list with this final name, and writes `head` as its first lines.
    pub(super) fn create(folder: &Folder, name: &str, head: &str) -> Result<Self, RecordingError> {
        let part = folder.create_file(name)?;
        part.file().write_all(head.as_bytes()).map_err(RecordingError::io("write", part.path()))?;
        let bytes = head.len() as u64;
        Ok(Self { part, bytes, bytes_before_last: bytes })
    }

    /// Appends a line. If that fails, the list is unchanged.
    pub(super) fn add_line(&mut self, line: std::fmt::Arguments) -> Result<(), RecordingError> {
        let line = format!("{line}\n");
        self.bytes_before_last = self.bytes;
        match self.part.file().write_all(line.as_bytes()) {
            Ok(()) => self.bytes += line.len() as u64,
            Err(error) => {
                self.remove_last_line();
                return Err(RecordingError::io("write", self.part.path())(error));
            }
        }
        Ok(())
    }

    /// Removes the last line, or the part of it that was written.
    pub(super) fn remove_last_line(&mut self) {
        self.bytes = self.bytes_before_last;
        let mut file = self.part.file();
        // The caller already has a more informative error to return.
        let _ = file.set_len(self.bytes);
        let _ = file.seek(SeekFrom::Start(self.bytes));
    }

    /// Renames the list to its final name.
    pub(super) fn commit(self, folder: &mut Folder) -> Result<(), RecordingError> {
        Ok(folder.commit_file(self.part)?)
    }

    /// Completes lists that a killed process left unfinished: lists of `names` in `dir` that have entries, and whose
    /// final name is free, are truncated to complete lines and renamed.
    pub(super) fn recover_interrupted(dir: &Path, names: &[&str]) -> Result<(), RecordingError> {
        for name in names {
            let list = dir.join(name);
            // If the folder is missing, there is nothing to rescue.
            for part in atomic_file::find_abandoned(&list).unwrap_or_default() {
                let is_taken = list.symlink_metadata().is_ok();
                if is_taken || !truncate_partial_line(&part).map_err(RecordingError::io("complete", &part))? {
                    continue;
                }
                atomic_file::rename(&part, &list, false).map_err(RecordingError::io("rename to", &list))?;
                list_file(dir, name)?;
                tracing::warn!("{}: restored from an interrupted recording", list.display());
            }
        }
        Ok(())
    }
}

/// Returns the hidden name of the list `name` that a killed process left unfinished in `dir`; `None` without entries.
pub(super) fn find_interrupted(dir: &Path, name: &str) -> Option<String> {
    let has_entry = |list: &PathBuf| {
        input::read(list, input::MAX_TEXT_BYTES).is_ok_and(|text| split_lines(whole_lines(&text)).next().is_some())
    };
    let list = atomic_file::find_abandoned(&dir.join(name)).ok()?.into_iter().find(has_entry)?;
    Some(list.file_name()?.to_str()?.to_owned())
}

/// Truncates an incomplete last line of a list; returns whether any entry is left.
fn truncate_partial_line(list: &Path) -> io::Result<bool> {
    let text = input::read(list, input::MAX_TEXT_BYTES)?;
    let whole_lines = whole_lines(&text);
    let file = OpenOptions::new().write(true).open(list)?;
    file.set_len(whole_lines.len() as u64)?;
    file.sync_all()?;
    Ok(split_lines(whole_lines).next().is_some())
}
