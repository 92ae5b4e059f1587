//! Files that appear whole or not at all: written beside their name, then renamed to it.

use std::fs::{self, File};
use std::io::{self, ErrorKind, LineWriter, Write};
use std::path::{Path, PathBuf};

use super::error::RecordingError;

/// A text file under construction. Its lines reach the disk one by one, under a name of their own, so that an
/// interrupted recording can be rescued by renaming its lists.
pub(super) struct WholeList {
    part: PathBuf,
    path: PathBuf,
    lines: LineWriter<File>,
}

impl WholeList {
    /// Where the list `path` is while it is being written.
    pub(super) fn part_of(path: &Path) -> PathBuf {
        with_suffix(path, "part")
    }

    /// Starts the list that will be at `path`.
    pub(super) fn create(path: PathBuf) -> Result<Self, RecordingError> {
        let part = Self::part_of(&path);
        let file = create_anew(&part).map_err(RecordingError::io("create", &part))?;
        Ok(Self { part, path, lines: LineWriter::new(file) })
    }

    /// Adds a line.
    pub(super) fn line(&mut self, line: std::fmt::Arguments) -> Result<(), RecordingError> {
        writeln!(self.lines, "{line}").map_err(RecordingError::io("write", &self.part))
    }

    /// Removes what was written.
    pub(super) fn abandon(self) {
        // The caller is on its way out with an error that says more than this one would.
        let _ = fs::remove_file(&self.part);
    }

    /// Lets the list appear under its name.
    pub(super) fn finish(mut self) -> Result<(), RecordingError> {
        self.lines.flush().map_err(RecordingError::io("write", &self.part))?;
        self.lines.get_ref().sync_all().map_err(RecordingError::io("write", &self.part))?;
        fs::rename(&self.part, &self.path).map_err(RecordingError::io("rename to", &self.path))
    }
}

/// Writes a file in one go. What was at `path` stays until the new content is safely on the disk.
pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<(), RecordingError> {
    // The process number keeps two programs that write the same file from renaming each other's halves.
    let part = with_suffix(path, &format!("{}.part", std::process::id()));
    let written = create_anew(&part).and_then(|mut file| {
        file.write_all(bytes)?;
        file.sync_all()
    });
    written.and_then(|()| fs::rename(&part, path)).map_err(|cause| {
        // It may not exist; the first failure is the one to tell.
        let _ = fs::remove_file(&part);
        RecordingError::io("write", path)(cause)
    })
}

/// Creates a file that was not there, so that nothing is written through a link left by somebody else.
fn create_anew(path: &Path) -> io::Result<File> {
    match File::create_new(path) {
        Err(error) if error.kind() == ErrorKind::AlreadyExists => {
            fs::remove_file(path)?;
            File::create_new(path)
        }
        created => created,
    }
}

fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".");
    name.push(suffix);
    name.into()
}
