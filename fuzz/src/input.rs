//! From the bytes of an input to numbers and files, and what holds for every message.

use std::path::{Path, PathBuf};

use tempfile::TempDir;

/// What is between the files of an input that stands for several: no text has it.
const BETWEEN_FILES: [u8; 2] = [0xff, 0xfe];

/// Numbers from the front of an input, little endian; zeros once it has ended.
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

/// The files that an input stands for, at least one.
pub fn files(mut data: &[u8]) -> Vec<&[u8]> {
    let mut files = Vec::new();
    while let Some(at) = data.windows(2).position(|pair| pair == BETWEEN_FILES) {
        files.push(&data[..at]);
        data = &data[at + BETWEEN_FILES.len()..];
    }
    files.push(data);
    files
}

thread_local! {
    static FOLDER: TempDir = TempDir::new().expect("a folder for temporary files");
}

/// Where this thread's file of this name is.
pub fn place(name: &str) -> PathBuf {
    FOLDER.with(|folder| folder.path().join(name))
}

/// Puts a file in its place; where the name has folders, they are made.
pub fn put(name: &str, bytes: &[u8]) -> PathBuf {
    let path = place(name);
    let write = |path: &Path| std::fs::write(path, bytes);
    if write(&path).is_err() {
        std::fs::create_dir_all(path.parent().unwrap()).and_then(|()| write(&path)).expect("room for temporary files");
    }
    path
}

/// A message is one line of a length that people read.
pub fn assert_one_line(message: impl ToString) {
    let message = message.to_string();
    assert!(!message.contains(['\n', '\r']), "more than one line: {message:?}");
    assert!(message.len() < 16_000, "a message of {} bytes", message.len());
}
