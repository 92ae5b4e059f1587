//! Atomic files: written under a hidden name in the same folder, synced, then renamed.
//!
//! The part file has a name that no other process uses, is never opened through a link, and is locked while it is being
//! written: if it can be locked, its process has died.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::os::fd::AsRawFd;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use rustix::fs::{CWD, FlockOperation, RenameFlags, flock, renameat_with};

const SUFFIX: &str = ".part";

/// A file under construction. Dropping it removes the part file.
#[derive(Debug)]
pub struct PartFile {
    /// The final path.
    path: PathBuf,
    /// The hidden path meanwhile.
    part: PathBuf,
    file: File,
    /// Whether the part file must be removed on drop.
    remove_on_drop: bool,
}

impl PartFile {
    /// Creates a part file for `path`, whose folder must exist.
    ///
    /// # Errors
    /// `path` has no file name, or the part file cannot be created.
    pub fn create(path: &Path) -> io::Result<Self> {
        let (folder, name) = split_file_name(path)?;
        loop {
            let part = folder.join(create_part_name(name));
            let file = File::create_new(&part)?;
            flock(&file, FlockOperation::NonBlockingLockExclusive)?;
            // Before it was locked, another process may have removed it as an abandoned part.
            if part.symlink_metadata().is_ok() {
                return Ok(Self { path: path.to_owned(), part, file, remove_on_drop: true });
            }
        }
    }

    /// Returns the final path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the path that it has until it is whole.
    pub fn part_path(&self) -> &Path {
        &self.part
    }

    /// Returns the open file, for writing and for its metadata.
    pub fn file(&self) -> &File {
        &self.file
    }

    /// Syncs the file and renames it to its final path. With `replace`, it atomically replaces an existing file, and
    /// takes over its permissions.
    ///
    /// # Errors
    /// [`ErrorKind::AlreadyExists`] without `replace`, or an error of the system. The part file is then removed.
    pub fn commit(mut self, replace: bool) -> io::Result<()> {
        self.try_commit(replace)
    }

    /// Does the same as [`PartFile::commit`], but on failure the part can still be [kept](Self::keep_incomplete).
    ///
    /// # Errors
    /// Same as for [`PartFile::commit`].
    pub fn try_commit(&mut self, replace: bool) -> io::Result<()> {
        if replace && let Ok(there) = fs::metadata(&self.path) {
            self.file.set_permissions(there.permissions())?;
        }
        self.file.sync_all()?;
        rename(&self.part, &self.path, replace)?;
        self.remove_on_drop = false;
        sync_folder(&self.path)
    }

    /// Does the same as [`PartFile::commit`] without replacing and without sync: the caller syncs later.
    ///
    /// # Errors
    /// Same as for [`PartFile::commit`].
    pub(super) fn commit_unsynced(mut self) -> io::Result<()> {
        rename(&self.part, &self.path, false)?;
        self.remove_on_drop = false;
        Ok(())
    }

    /// Returns whether the file was removed, alone or with its folder. Its content is still readable here.
    pub fn is_removed(&self) -> bool {
        // Not every file system has a correct link count.
        self.file.metadata().is_ok_and(|file| file.nlink() == 0) && self.current_path().is_none()
    }

    /// Returns the file's current path, which changes if its folder was renamed.
    fn current_path(&self) -> Option<PathBuf> {
        let identity = |file: fs::Metadata| (file.dev(), file.ino());
        let own = identity(self.file.metadata().ok()?);
        let is_own = |path: &PathBuf| path.symlink_metadata().is_ok_and(|there| identity(there) == own);
        let renamed = || fs::read_link(self.descriptor_path()).ok().filter(is_own);
        Some(self.part.clone()).filter(is_own).or_else(renamed)
    }

    /// Returns a path to the open file in `/proc`.
    fn descriptor_path(&self) -> String {
        format!("/proc/self/fd/{}", self.file.as_raw_fd())
    }

    /// Keeps an incomplete file under the name of [`keep_incomplete`], or under its hidden name if it cannot be
    /// renamed; returns the path. A removed file is copied to the nearest folder that still exists.
    ///
    /// # Errors
    /// The file was removed and cannot be copied: it is lost.
    pub fn keep_incomplete(mut self) -> io::Result<PathBuf> {
        // From here on it must not be removed, even if it cannot be synced or renamed.
        self.remove_on_drop = false;
        let _ = self.file.sync_all();
        let Some(part) = self.current_path() else { return self.copy_incomplete() };
        let path = match part == self.part {
            true => self.path.clone(),
            false => part.with_file_name(self.path.file_name().unwrap_or_default()),
        };
        Ok(keep_incomplete(&part, &path).unwrap_or(part))
    }

    /// Copies the file to the nearest existing folder: a file without a name cannot be linked again.
    fn copy_incomplete(&self) -> io::Result<PathBuf> {
        let (folder, name) = split_file_name(&self.path)?;
        let folder = std::path::absolute(folder)?;
        let existing = folder.ancestors().find(|folder| folder.is_dir()).unwrap_or(Path::new("/"));
        let copy = Self::create(&existing.join(name))?;
        // Warn first, as copying may take long.
        tracing::warn!("{} was removed: its content so far is copied to {}", self.path.display(), existing.display());
        io::copy(&mut File::open(self.descriptor_path())?, &mut copy.file())?;
        copy.keep_incomplete()
    }
}

impl Drop for PartFile {
    fn drop(&mut self) {
        if let Some(part) = self.remove_on_drop.then(|| self.current_path()).flatten() {
            // A failure cannot be reported here.
            let _ = fs::remove_file(part);
        }
    }
}

/// Writes a file atomically; `replace` as for [`PartFile::commit`].
///
/// # Errors
/// Same as for [`PartFile::create`] and [`PartFile::commit`], or the file cannot be written.
pub fn write(path: &Path, bytes: &[u8], replace: bool) -> io::Result<()> {
    let part = PartFile::create(path)?;
    part.file().write_all(bytes)?;
    part.commit(replace)
}

/// Renames a file or folder within one file system; without `replace`, never over an existing one.
///
/// # Errors
/// [`ErrorKind::AlreadyExists`] without `replace`, or an error of the system.
pub fn rename(from: &Path, to: &Path, replace: bool) -> io::Result<()> {
    if replace {
        return fs::rename(from, to);
    }
    match renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE) {
        // Some file systems do not support NOREPLACE.
        Err(rustix::io::Errno::INVAL | rustix::io::Errno::NOSYS) => match to.symlink_metadata() {
            Ok(_) => Err(ErrorKind::AlreadyExists.into()),
            Err(_) => fs::rename(from, to),
        },
        renamed => Ok(renamed?),
    }
}

/// Renames an incomplete file `part` to `NAME.incomplete.EXT` (so that players still open it), or to
/// `NAME.incomplete.2.EXT` and so on if the name exists.
///
/// # Errors
/// Returns the error of the system.
pub fn keep_incomplete(part: &Path, path: &Path) -> io::Result<PathBuf> {
    for number in 1.. {
        let mut kept = path.file_stem().unwrap_or_default().to_owned();
        kept.push(if number == 1 { ".incomplete".into() } else { format!(".incomplete.{number}") });
        if let Some(ending) = path.extension() {
            kept.push(".");
            kept.push(ending);
        }
        let kept = path.with_file_name(kept);
        match rename(part, &kept, false) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            renamed => return renamed.map(|()| kept),
        }
    }
    Err(ErrorKind::AlreadyExists.into())
}

/// Keeps the files that killed runs left of `path` under the names of [`keep_incomplete`], which is logged.
///
/// # Errors
/// Returns the error of the system.
pub fn keep_leftovers(path: &Path) -> io::Result<()> {
    // A folder may be writable without being readable.
    for part in find_abandoned(path).unwrap_or_default() {
        if let Some(kept) = keep_or_remove_part(&part, path)? {
            tracing::warn!("{}: the unfinished output of an earlier run is kept as {}", path.display(), kept.display());
        }
    }
    Ok(())
}

/// Renames an abandoned part to `path` with `.incomplete` in the name, and returns that name; removes an empty one.
///
/// # Errors
/// Returns the error of the system.
pub fn keep_or_remove_part(part: &Path, path: &Path) -> io::Result<Option<PathBuf>> {
    let done = match part.metadata().map(|part| part.len()) {
        Ok(0) => fs::remove_file(part).map(|()| None),
        Ok(_) => keep_incomplete(part, path).map(Some),
        Err(error) => Err(error),
    };
    match done {
        // Another process did the same at the same time.
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        done => done,
    }
}

/// Returns the bytes that this process has written so far for a file at `path`; `None` if it writes no such file.
pub fn bytes_written(path: &Path) -> Option<u64> {
    let (folder, name) = split_file_name(path).ok()?;
    let own = format!(".{}-", std::process::id());
    let parts = fs::read_dir(folder).ok()?.flatten().filter(|entry| {
        let part = entry.file_name();
        parse_part_name(&part) == Some(name) && part.to_string_lossy().contains(&own)
    });
    parts.filter_map(|part| part.metadata().ok()).map(|part| part.len()).max()
}

/// Returns the part files of `path` whose process is gone. They are not locked, so the caller may remove or keep them.
///
/// # Errors
/// The folder cannot be read.
pub fn find_abandoned(path: &Path) -> io::Result<Vec<PathBuf>> {
    let (folder, name) = split_file_name(path)?;
    let all = find_all_abandoned(folder)?.into_iter();
    Ok(all.filter(|(_, of)| of == name).map(|(part, _)| part).collect())
}

/// Returns all part files in a folder whose process is gone, each with its final name.
///
/// # Errors
/// The folder cannot be read.
pub fn find_all_abandoned(folder: &Path) -> io::Result<Vec<(PathBuf, OsString)>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name();
        let Some(final_name) = parse_part_name(&name).filter(|_| entry.file_type().is_ok_and(|kind| kind.is_file()))
        else {
            continue;
        };
        let is_free = |file: File| flock(&file, FlockOperation::NonBlockingLockExclusive).is_ok();
        if super::input::open(&entry.path()).is_ok_and(is_free) {
            found.push((entry.path(), final_name.to_owned()));
        }
    }
    found.sort();
    Ok(found)
}

/// Syncs the folder of `path`, so that the file's name is on disk as well.
pub(super) fn sync_folder(path: &Path) -> io::Result<()> {
    let (folder, _) = split_file_name(path)?;
    // Not every file system can sync folders; the file itself is on disk.
    let _ = File::open(folder)?.sync_all();
    Ok(())
}

/// Splits a path into folder and file name.
fn split_file_name(path: &Path) -> io::Result<(&Path, &OsStr)> {
    let name =
        path.file_name().ok_or_else(|| io::Error::new(ErrorKind::InvalidInput, "this is not the name of a file"))?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Ok((folder, name))
}

/// Returns a new part name: `.NAME.PROCESS-NUMBER.part`.
fn create_part_name(name: &OsStr) -> OsString {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let mut part = OsString::from(".");
    part.push(name);
    part.push(format!(".{}-{}{SUFFIX}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed)));
    part
}

/// Returns whether a name is that of a part file.
pub fn is_part_name(name: &OsStr) -> bool {
    parse_part_name(name).is_some()
}

/// Returns the final name of a part file; `None` if the name does not have the form of [`create_part_name`].
pub(super) fn parse_part_name(part: &OsStr) -> Option<&OsStr> {
    let part = part.as_bytes().strip_prefix(b".")?.strip_suffix(SUFFIX.as_bytes())?;
    let (name, numbers) = part.split_at(part.iter().rposition(|&byte| byte == b'.')?);
    let mut numbers = numbers[1..].split(|&byte| byte == b'-');
    let is_number = |part: Option<&[u8]>| part.is_some_and(|p| !p.is_empty() && p.iter().all(u8::is_ascii_digit));
    let is_part =
        !name.is_empty() && is_number(numbers.next()) && is_number(numbers.next()) && numbers.next().is_none();
    is_part.then(|| OsStr::from_bytes(name))
}

#[cfg(test)]
mod tests;
