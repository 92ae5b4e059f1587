//! A list that grows with a recording, and appears when that is whole.

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
    /// Bytes of whole lines, and of those before the last one.
    bytes: u64,
    before: u64,
}

impl GrowingList {
    /// Starts the list of this name, with `head` as its first lines.
    pub(super) fn create(folder: &Folder, name: &str, head: &str) -> Result<Self, RecordingError> {
        let part = folder.begin(name)?;
        part.file().write_all(head.as_bytes()).map_err(RecordingError::io("write", part.path()))?;
        let bytes = head.len() as u64;
        Ok(Self { part, bytes, before: bytes })
    }

    /// Adds a line. Where that fails, the list stays as it was.
    pub(super) fn line(&mut self, line: std::fmt::Arguments) -> Result<(), RecordingError> {
        let line = format!("{line}\n");
        self.before = self.bytes;
        match self.part.file().write_all(line.as_bytes()) {
            Ok(()) => self.bytes += line.len() as u64,
            Err(error) => {
                self.take_back();
                return Err(RecordingError::io("write", self.part.path())(error));
            }
        }
        Ok(())
    }

    /// Removes the line that was added last.
    pub(super) fn take_back(&mut self) {
        self.bytes = self.before;
        let mut file = self.part.file();
        // The caller is on its way out with an error that says more than this one would.
        let _ = file.set_len(self.bytes);
        let _ = file.seek(SeekFrom::Start(self.bytes));
    }

    /// Lets the list appear under its name.
    pub(super) fn put(self, folder: &mut Folder) -> Result<(), RecordingError> {
        Ok(folder.put(self.part)?)
    }

    /// Lets those of the lists `names` in `dir` appear whose process was killed, as far as their lines are whole.
    pub(super) fn rescue(dir: &Path, names: &[&str]) -> Result<(), RecordingError> {
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
                    folder::adopt(&folder, [(*name).to_owned()])?;
                    tracing::warn!("{}: completed, as far as an interrupted recording came", list.display());
                }
            }
        }
        Ok(())
    }
}

/// Takes a half line from the end of a list. Gives whether anything but comments is left.
fn cut_half_line(list: &Path) -> io::Result<bool> {
    let text = input::read(list, input::MOST_TEXT_BYTES)?;
    let whole = &text[..text.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1)];
    let file = OpenOptions::new().write(true).open(list)?;
    file.set_len(whole.len() as u64)?;
    file.sync_all()?;
    Ok(lines(whole).next().is_some())
}
