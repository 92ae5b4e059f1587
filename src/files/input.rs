//! Files that others wrote, read within bounds: no device, no pipe without an end, and no more than expected.

use std::fs::{File, FileType, OpenOptions};
use std::io::{self, Read};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::Path;

use rustix::fs::OFlags;

/// Most bytes of a text that people or their tools write, such as a list.
pub const MOST_TEXT_BYTES: u64 = 64 << 20;

/// Most bytes of a calibration: they have a few thousand.
pub const MOST_CALIBRATION_BYTES: u64 = 1 << 20;

/// Most bytes of a settings file: enough for every setting in a thousand presets.
pub const MOST_SETTINGS_BYTES: u64 = 1 << 20;

/// What is said of a file that is not there.
pub const NO_FILE: &str = "there is no such file";

/// What the system says, in the words of this program where these are shorter.
pub fn said(error: &io::Error) -> String {
    let text = error.to_string();
    match error.kind() {
        io::ErrorKind::NotFound if error.raw_os_error().is_some() => NO_FILE.to_owned(),
        _ => text.split(" (os error").next().unwrap_or_default().to_owned(),
    }
}

/// Opens a regular file for reading, links followed. Never waits, as opening a pipe would.
///
/// # Errors
/// What the system says, or [`io::ErrorKind::InvalidInput`] with the kind of file it is instead.
pub fn open(path: &Path) -> io::Result<File> {
    let file = OpenOptions::new().read(true).custom_flags(OFlags::NONBLOCK.bits() as i32).open(path)?;
    match unlike_file(file.metadata()?.file_type()) {
        None => Ok(file),
        Some(what) => Err(io::Error::new(io::ErrorKind::InvalidInput, format!("it is {what}, not a file"))),
    }
}

/// Reads a regular file of at most `most_bytes` bytes.
///
/// # Errors
/// As for [`open`], or [`io::ErrorKind::FileTooLarge`] with both sizes; nothing of such a file is read.
pub fn read(path: &Path, most_bytes: u64) -> io::Result<Vec<u8>> {
    let file = open(path)?;
    let expected_bytes = file.metadata()?.len();
    refuse_beyond(most_bytes, expected_bytes)?;
    let mut bytes = Vec::with_capacity(expected_bytes as usize);
    // It may grow meanwhile, or state no size, as files under /proc do.
    file.take(most_bytes + 1).read_to_end(&mut bytes)?;
    refuse_beyond(most_bytes, bytes.len() as u64)?;
    Ok(bytes)
}

/// Reads a regular file of at most `most_bytes` bytes of UTF-8.
///
/// # Errors
/// As for [`read`], or [`io::ErrorKind::InvalidData`].
pub fn read_text(path: &Path, most_bytes: u64) -> io::Result<String> {
    let text = String::from_utf8(read(path, most_bytes)?);
    text.map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is no text in UTF-8"))
}

fn refuse_beyond(most_bytes: u64, bytes: u64) -> io::Result<()> {
    if bytes <= most_bytes {
        return Ok(());
    }
    let what = format!("it is too large: {bytes} bytes, where at most {most_bytes} make sense");
    Err(io::Error::new(io::ErrorKind::FileTooLarge, what))
}

/// What is at a place where a file is to be written, where that is none and so is never replaced by one.
pub fn no_file_at(path: &Path) -> Option<&'static str> {
    unlike_file(path.metadata().ok()?.file_type())
}

/// The kind of a file that is no regular one, in words.
fn unlike_file(kind: FileType) -> Option<&'static str> {
    match kind {
        _ if kind.is_file() => None,
        _ if kind.is_dir() => Some("a folder"),
        _ if kind.is_fifo() => Some("a pipe"),
        _ if kind.is_socket() => Some("a socket"),
        _ => Some("a device"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_regular_files_of_a_sensible_size_are_read() {
        let dir = tempfile::tempdir().unwrap();
        let pipe = dir.path().join("pipe");
        rustix::fs::mkfifoat(rustix::fs::CWD, &pipe, rustix::fs::Mode::RUSR).unwrap();
        let link = dir.path().join("zeros");
        std::os::unix::fs::symlink("/dev/zero", &link).unwrap();
        for (path, what) in [(pipe.as_path(), "a pipe"), (&link, "a device"), (dir.path(), "a folder")] {
            assert_eq!(read(path, 10).unwrap_err().to_string(), format!("it is {what}, not a file"));
        }
        let file = dir.path().join("text");
        std::fs::write(&file, "0123456789").unwrap();
        assert_eq!(read_text(&file, 10).unwrap(), "0123456789");
        assert_eq!(read(&file, 9).unwrap_err().kind(), io::ErrorKind::FileTooLarge);
        std::fs::write(&file, [0xff]).unwrap();
        assert_eq!(read_text(&file, 10).unwrap_err().kind(), io::ErrorKind::InvalidData);
        // A file that states no size.
        assert!(!read(Path::new("/proc/self/status"), MOST_TEXT_BYTES).unwrap().is_empty());
    }
}
