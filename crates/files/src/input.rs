//! Reads files of unknown origin within bounds: no devices, no endless pipes, and no more bytes than expected.

use std::fs::{File, FileType, OpenOptions};
use std::io::{self, Read};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::Path;

use rustix::fs::OFlags;

/// Maximum size of a text written by people or their tools, such as a list.
pub const MAX_TEXT_BYTES: u64 = 64 << 20;

/// Maximum size of a calibration; they have a few thousand bytes.
pub const MAX_CALIBRATION_BYTES: u64 = 1 << 20;

/// Maximum size of a settings file: enough for every setting in a thousand presets.
pub const MAX_SETTINGS_BYTES: u64 = 1 << 20;

/// The message for a missing file.
pub const NO_FILE: &str = "there is no such file";

/// Returns the system's error message, shortened.
pub fn format_io_error(error: &io::Error) -> String {
    let text = error.to_string();
    match error.kind() {
        io::ErrorKind::NotFound if error.raw_os_error().is_some() => NO_FILE.to_owned(),
        _ => text.split(" (os error").next().unwrap_or_default().to_owned(),
    }
}

/// Opens a regular file for reading; follows links. Never blocks, as opening a pipe would.
///
/// # Errors
/// Returns the system's error, or [`io::ErrorKind::InvalidInput`] with the kind of the file if it is not regular.
pub fn open(path: &Path) -> io::Result<File> {
    let file = OpenOptions::new().read(true).custom_flags(OFlags::NONBLOCK.bits() as i32).open(path)?;
    match special_kind(file.metadata()?.file_type()) {
        None => Ok(file),
        Some(what) => Err(io::Error::new(io::ErrorKind::InvalidInput, format!("it is {what}, not a file"))),
    }
}

/// Reads a regular file of at most `max_bytes` bytes.
///
/// # Errors
/// Same as for [`open`], or [`io::ErrorKind::FileTooLarge`] with both sizes, without reading.
pub fn read(path: &Path, max_bytes: u64) -> io::Result<Vec<u8>> {
    let file = open(path)?;
    let expected_bytes = file.metadata()?.len();
    check_size(max_bytes, expected_bytes)?;
    let mut bytes = Vec::with_capacity(expected_bytes as usize);
    // The file may grow meanwhile, or report no size, as files under /proc do.
    file.take(max_bytes + 1).read_to_end(&mut bytes)?;
    check_size(max_bytes, bytes.len() as u64)?;
    Ok(bytes)
}

/// Reads a regular file of at most `max_bytes` bytes of UTF-8.
///
/// # Errors
/// Same as for [`read`], or [`io::ErrorKind::InvalidData`].
pub fn read_text(path: &Path, max_bytes: u64) -> io::Result<String> {
    let text = String::from_utf8(read(path, max_bytes)?);
    text.map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is not UTF-8 text"))
}

fn check_size(max_bytes: u64, bytes: u64) -> io::Result<()> {
    if bytes <= max_bytes {
        return Ok(());
    }
    let what = format!("it is too large: {bytes} bytes, and at most {max_bytes} are accepted");
    Err(io::Error::new(io::ErrorKind::FileTooLarge, what))
}

/// Returns the kind of an existing special file or folder at an output path, which must not be replaced; `None` for a
/// regular file, or none at all.
pub fn find_special_file_kind(path: &Path) -> Option<&'static str> {
    special_kind(path.metadata().ok()?.file_type())
}

/// Returns the kind of a file in words; `None` for a regular file.
fn special_kind(kind: FileType) -> Option<&'static str> {
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
        // A file that reports no size.
        assert!(!read(Path::new("/proc/self/status"), MAX_TEXT_BYTES).unwrap().is_empty());
    }
}
