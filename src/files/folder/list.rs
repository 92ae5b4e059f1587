//! The list of files that we wrote into a folder.

use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{ErrorKind, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Component, Path, PathBuf};

use rustix::fs::OFlags;

use super::{FolderError, LIST};
use crate::files::{input, whole};

/// A list that grows.
#[derive(Debug)]
pub(super) struct List {
    path: PathBuf,
    file: File,
    bytes: u64,
    len: u64,
}

impl List {
    /// Begins a new list in `folder`, in place of one whose files are gone.
    pub(super) fn create(folder: &Path) -> Result<Self, FolderError> {
        let path = folder.join(LIST);
        let removed = match fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        };
        let file = removed.and_then(|()| File::create_new(&path)).map_err(FolderError::write(&path))?;
        Ok(Self { path, file, bytes: 0, len: 0 })
    }

    /// Adds to the list of `folder`, which is made where it is missing. Never through a link.
    pub(super) fn open(folder: &Path) -> Result<Self, FolderError> {
        let path = folder.join(LIST);
        let mut options = File::options();
        options.append(true).create(true).custom_flags(OFlags::NOFOLLOW.bits() as i32);
        let opened = options.open(&path).and_then(|mut file| {
            // Its last line may have no end.
            file.write_all(b"\n")?;
            Ok((file.metadata()?.len(), file))
        });
        let (bytes, file) = opened.map_err(FolderError::write(&path))?;
        Ok(Self { path, file, bytes, len: 0 })
    }

    pub(super) fn len(&self) -> u64 {
        self.len
    }

    /// Adds a name. Where that fails, the list stays as it was.
    pub(super) fn add(&mut self, name: &str) -> Result<(), FolderError> {
        let line = format!("{name}\n");
        if let Err(cause) = self.file.write_all(line.as_bytes()) {
            // A name that was cut could be that of another file. The first error is the one to report.
            let _ = self.file.set_len(self.bytes);
            return Err(FolderError::Write { path: self.path.clone(), cause });
        }
        self.bytes += line.len() as u64;
        self.len += 1;
        Ok(())
    }
}

/// The names in a list.
#[derive(Debug, Default)]
pub(super) struct Names {
    /// In the order in which they were written.
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

/// The names in the list of `folder`; none where there is no list. What does not lie within the folder, at most one
/// folder down, is passed over.
pub(super) fn read(folder: &Path) -> Result<Names, FolderError> {
    let path = folder.join(LIST);
    // Never through a link: it would be the list of another folder.
    if !fs::symlink_metadata(&path).is_ok_and(|there| there.is_file()) {
        return Ok(Names::default());
    }
    let text = input::read_text(&path, input::MOST_TEXT_BYTES).map_err(FolderError::write(&path))?;
    let ordered: Vec<String> = text.lines().filter(|name| lies_within(name)).map(str::to_owned).collect();
    let all = ordered.iter().cloned().collect();
    Ok(Names { ordered, all })
}

/// Adds existing files to the list of `folder`, which is made where it is missing, so that a run may replace them:
/// files that are known in another way to belong to what it replaces. What does not lie within the folder, at most one
/// folder down, is passed over.
///
/// # Errors
/// The list cannot be read or written.
pub fn adopt(folder: &Path, names: impl IntoIterator<Item = String>) -> Result<(), FolderError> {
    let known = read(folder)?;
    let mut seen = HashSet::new();
    let new = names.into_iter().filter(|name| lies_within(name) && !known.contains(name));
    let lines: String = new.filter(|name| seen.insert(name.clone())).map(|name| name + "\n").collect();
    if lines.is_empty() {
        return Ok(());
    }
    let path = folder.join(LIST);
    let list = known.ordered.iter().map(|name| format!("{name}\n")).collect::<String>() + &lines;
    whole::write(&path, list.as_bytes(), true).map_err(FolderError::write(&path))
}

/// Whether a name is a plain path of at most one folder and a file that is not hidden.
fn lies_within(name: &str) -> bool {
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
            assert!(lies_within(name), "{name}");
        }
        let bad =
            ["", ".", "..", ".hidden", "../0.png", "rgb/..", "rgb/../0.png", "rgb/../../0.png", "/0.png", "a/b/0.png"];
        for name in bad {
            assert!(!lies_within(name), "{name}");
        }
    }
}
