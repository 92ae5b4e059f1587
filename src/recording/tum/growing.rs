//! A list that grows with a recording, and gets its name when that is whole.

use std::fs::OpenOptions;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;

use crate::files::folder::{self, Folder};
use crate::files::input;
use crate::files::whole::{self, Part};
use crate::recording::error::RecordingError;
use crate::recording::list::lines;

/// A list under construction. Its lines reach the disk one by one, so that they are there if the process is killed.
pub(super) struct GrowingList {
    part: Part,
    /// Bytes of whole lines.
    bytes: u64,
    /// The same without the last line.
    bytes_before_last: u64,
}

impl GrowingList {
    /// Starts the list of this name, with `head` as its first lines.
    pub(super) fn create(folder: &Folder, name: &str, head: &str) -> Result<Self, RecordingError> {
        let part = folder.begin(name)?;
        part.file().write_all(head.as_bytes()).map_err(RecordingError::io("write", part.path()))?;
        let bytes = head.len() as u64;
        Ok(Self { part, bytes, bytes_before_last: bytes })
    }

    /// Adds a line. Where that fails, the list stays as it was.
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

    /// Removes the line that was added last, or the part of it that was written.
    pub(super) fn remove_last_line(&mut self) {
        self.bytes = self.bytes_before_last;
        let mut file = self.part.file();
        // The caller already has an error to return, which says more.
        let _ = file.set_len(self.bytes);
        let _ = file.seek(SeekFrom::Start(self.bytes));
    }

    /// Gives the list its name.
    pub(super) fn put(self, folder: &mut Folder) -> Result<(), RecordingError> {
        Ok(folder.put(self.part)?)
    }

    /// Completes lists that a killed process left unfinished: those of `names` in `dir` that have whole lines and whose
    /// name is free get their name, without a last line that was cut.
    pub(super) fn rescue(dir: &Path, names: &[&str]) -> Result<(), RecordingError> {
        // In `PART`, a recording that was to replace another waits.
        for folder in [dir.to_owned(), dir.join(folder::PART)] {
            for name in names {
                let list = folder.join(name);
                // Without a folder there is nothing to rescue.
                for part in whole::left_behind(&list).unwrap_or_default() {
                    let is_taken = list.symlink_metadata().is_ok();
                    if is_taken || !cut_half_line(&part).map_err(RecordingError::io("complete", &part))? {
                        continue;
                    }
                    whole::rename(&part, &list, false).map_err(RecordingError::io("rename to", &list))?;
                    // So that later runs know the list as one of ours.
                    folder::adopt(&folder, [(*name).to_owned()])?;
                    tracing::warn!("{}: completed, as far as an interrupted recording came", list.display());
                }
            }
        }
        Ok(())
    }
}

/// Cuts an incomplete line off the end of a list. Gives whether it has any entry left.
fn cut_half_line(list: &Path) -> io::Result<bool> {
    let text = input::read(list, input::MOST_TEXT_BYTES)?;
    let whole_lines = &text[..text.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1)];
    let file = OpenOptions::new().write(true).open(list)?;
    file.set_len(whole_lines.len() as u64)?;
    file.sync_all()?;
    Ok(lines(whole_lines).next().is_some())
}
