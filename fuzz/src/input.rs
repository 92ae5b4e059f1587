//! Conversion of fuzz input to numbers and files, and the check of messages.

use std::path::{Path, PathBuf};

use tempfile::TempDir;

/// Separator of the files in one input; never valid UTF-8.
const FILE_SEPARATOR: [u8; 2] = [0xff, 0xfe];

/// Reads little-endian numbers from the start of an input; zeros after its end.
pub struct Numbers<'a>(pub &'a [u8]);

impl Numbers<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let mut bytes = [0; N];
        let (head, rest) = self.0.split_at(self.0.len().min(N));
        bytes[..head.len()].copy_from_slice(head);
        self.0 = rest;
        bytes
    }

    pub fn u8(&mut self) -> u8 {
        u8::from_le_bytes(self.take())
    }

    pub fn u16(&mut self) -> u16 {
        u16::from_le_bytes(self.take())
    }

    pub fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }
}

/// Splits an input into its files, at least one.
pub fn split_files(mut data: &[u8]) -> Vec<&[u8]> {
    let mut files = Vec::new();
    while let Some(at) = data.windows(2).position(|pair| pair == FILE_SEPARATOR) {
        files.push(&data[..at]);
        data = &data[at + FILE_SEPARATOR.len()..];
    }
    files.push(data);
    files
}

thread_local! {
    static FOLDER: TempDir = TempDir::new().expect("a folder for temporary files");
}

/// Returns the path of this thread's file `name`.
pub fn file_path(name: &str) -> PathBuf {
    FOLDER.with(|folder| folder.path().join(name))
}

/// Writes a file, and creates the folders in its name.
pub fn write_file(name: &str, bytes: &[u8]) -> PathBuf {
    let path = file_path(name);
    let write = |path: &Path| std::fs::write(path, bytes);
    if write(&path).is_err() {
        std::fs::create_dir_all(path.parent().unwrap()).and_then(|()| write(&path)).expect("room for temporary files");
    }
    path
}

/// Asserts that a message is one line of readable length.
pub fn assert_one_line(message: impl ToString) {
    let message = message.to_string();
    assert!(!message.contains(['\n', '\r']), "more than one line: {message:?}");
    assert!(message.len() < 16_000, "a message of {} bytes", message.len());
}
