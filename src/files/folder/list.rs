//! The list of the files that we wrote into a folder.

use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{ErrorKind, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Component, Path, PathBuf};

use rustix::fs::OFlags;

use super::{FolderError, LIST_NAME};
use crate::files::{atomic_file, input};

/// A list that is being written.
#[derive(Debug)]
pub(super) struct List {
    path: PathBuf,
    file: File,
    bytes: u64,
    len: u64,
}

impl List {
    /// Creates a new list in `folder`; replaces an old one, whose files are gone.
    pub(super) fn create(folder: &Path) -> Result<Self, FolderError> {
        let path = folder.join(LIST_NAME);
        let removed = match fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        };
        let file = removed.and_then(|()| File::create_new(&path)).map_err(FolderError::cannot_write(&path))?;
        Ok(Self { path, file, bytes: 0, len: 0 })
    }

    /// Opens the list of `folder` for appending; creates it if needed. Does not follow links.
    pub(super) fn open(folder: &Path) -> Result<Self, FolderError> {
        let path = folder.join(LIST_NAME);
        let mut options = File::options();
        options.append(true).create(true).custom_flags(OFlags::NOFOLLOW.bits() as i32);
        let opened = options.open(&path).and_then(|mut file| {
            // The last line may be unterminated.
            file.write_all(b"\n")?;
            Ok((file.metadata()?.len(), file))
        });
        let (bytes, file) = opened.map_err(FolderError::cannot_write(&path))?;
        Ok(Self { path, file, bytes, len: 0 })
    }

    pub(super) fn len(&self) -> u64 {
        self.len
    }

    /// Appends a name. If that fails, the list is unchanged.
    pub(super) fn add(&mut self, name: &str) -> Result<(), FolderError> {
        let line = format!("{name}\n");
        if let Err(cause) = self.file.write_all(line.as_bytes()) {
            // A truncated name could be that of another file. Report the first error.
            let _ = self.file.set_len(self.bytes);
            return Err(FolderError::Write { path: self.path.clone(), cause });
        }
        self.bytes += line.len() as u64;
        self.len += 1;
        Ok(())
    }
}

/// The names on a list.
#[derive(Debug, Default)]
pub(super) struct Names {
    /// In the order of writing.
    ordered: Vec<String>,
    all: HashSet<String>,
}

impl Names {
    pub(super) fn contains(&self, name: &str) -> bool {
        self.all.contains(name)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.ordered.is_empty()
    }

    pub(super) fn iter(&self) -> impl DoubleEndedIterator<Item = &String> {
        self.ordered.iter()
    }
}

/// Reads the names on the list of `folder`; empty without a list. Skips names outside the folder or more than one
/// folder deep.
pub(super) fn read_names(folder: &Path) -> Result<Names, FolderError> {
    let path = folder.join(LIST_NAME);
    // Do not follow a link: it could lead to another folder's list.
    if !fs::symlink_metadata(&path).is_ok_and(|there| there.is_file()) {
        return Ok(Names::default());
    }
    let text = input::read_text(&path, input::MAX_TEXT_BYTES).map_err(FolderError::cannot_write(&path))?;
    let ordered: Vec<String> = text.lines().filter(|name| is_within(name)).map(str::to_owned).collect();
    let all = ordered.iter().cloned().collect();
    Ok(Names { ordered, all })
}

/// Adds existing files to the list of `folder`, which is created if needed, so that a run may replace them. The caller
/// knows from elsewhere that they belong to the old set. Skips names outside the folder or more than one folder deep.
///
/// # Errors
/// The list cannot be read or written.
pub fn adopt_files(folder: &Path, names: impl IntoIterator<Item = String>) -> Result<(), FolderError> {
    let known = read_names(folder)?;
    let mut seen = HashSet::new();
    let new = names.into_iter().filter(|name| is_within(name) && !known.contains(name));
    let lines: String = new.filter(|name| seen.insert(name.clone())).map(|name| name + "\n").collect();
    if lines.is_empty() {
        return Ok(());
    }
    let path = folder.join(LIST_NAME);
    let list = known.ordered.iter().map(|name| format!("{name}\n")).collect::<String>() + &lines;
    atomic_file::write(&path, list.as_bytes(), true).map_err(FolderError::cannot_write(&path))
}

/// Returns whether a name is a plain path of at most one folder and a file that is not hidden.
fn is_within(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    let is_plain = |part: Option<Component>| part.is_none_or(|part| matches!(part, Component::Normal(_)));
    !name.is_empty()
        && !name.starts_with('.')
        && is_plain(parts.next())
        && is_plain(parts.next())
        && parts.next().is_none()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_leads_one_folder_down_at_most_and_never_up() {
        for name in ["0.png", "rgb/0.png", "rgb.txt", "rgb/..0.png"] {
            assert!(is_within(name), "{name}");
        }
        let bad =
            ["", ".", "..", ".hidden", "../0.png", "rgb/..", "rgb/../0.png", "rgb/../../0.png", "/0.png", "a/b/0.png"];
        for name in bad {
            assert!(!is_within(name), "{name}");
        }
    }
}
