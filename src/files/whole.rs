//! Files that appear under their name only when they are whole: written beside it, synced, then renamed.
//!
//! The part file is hidden, has a name that no other process uses, is never opened through a link, and is locked while
//! it is being written: one that can be locked was left behind by a process that died.

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

/// A file under construction. Dropping it removes what was written.
#[derive(Debug)]
pub struct Part {
    /// The name in the end.
    path: PathBuf,
    /// The hidden name meanwhile.
    part: PathBuf,
    file: File,
    /// Whether there is anything left to remove.
    open: bool,
}

impl Part {
    /// Starts the file that will be at `path`; the folder above it must be there.
    ///
    /// # Errors
    /// `path` names no file, or the part cannot be made beside it.
    pub fn create(path: &Path) -> io::Result<Self> {
        let (folder, name) = split(path)?;
        loop {
            let part = folder.join(part_name(name));
            let file = File::create_new(&part)?;
            flock(&file, FlockOperation::NonBlockingLockExclusive)?;
            // Before it was locked, another process may have taken it for one left behind, and removed it.
            if part.symlink_metadata().is_ok() {
                return Ok(Self { path: path.to_owned(), part, file, open: true });
            }
        }
    }

    /// The name in the end.
    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn part(&self) -> &Path {
        &self.part
    }

    /// The open file, for reading its state and for writing.
    pub fn file(&self) -> &File {
        &self.file
    }

    /// Gives the file its name once it is safely on the disk. With `replace`, it takes the place of what is there, in
    /// one step, and has its permissions.
    ///
    /// # Errors
    /// [`ErrorKind::AlreadyExists`] without `replace`, or what the system says. The part is then removed.
    pub fn commit(mut self, replace: bool) -> io::Result<()> {
        self.try_commit(replace)
    }

    /// As [`Part::commit`], but a part that could not be given its name can still be [kept](Self::keep_incomplete).
    ///
    /// # Errors
    /// As for [`Part::commit`].
    pub fn try_commit(&mut self, replace: bool) -> io::Result<()> {
        if replace && let Ok(there) = fs::metadata(&self.path) {
            self.file.set_permissions(there.permissions())?;
        }
        self.file.sync_all()?;
        rename(&self.part, &self.path, replace)?;
        self.open = false;
        sync_folder(&self.path)
    }

    /// As [`Part::commit`] without replacing, and without waiting for the disk: the caller syncs the file system later.
    ///
    /// # Errors
    /// As for [`Part::commit`].
    pub fn commit_unsynced(mut self) -> io::Result<()> {
        rename(&self.part, &self.path, false)?;
        self.open = false;
        Ok(())
    }

    /// Whether somebody removed it, alone or with its folder. What was written can still be read here.
    pub fn is_removed(&self) -> bool {
        // Not every file system counts names.
        self.file.metadata().is_ok_and(|file| file.nlink() == 0) && self.whereabouts().is_none()
    }

    /// Where the file is by now: whoever renamed its folder took it along.
    fn whereabouts(&self) -> Option<PathBuf> {
        let identity = |file: fs::Metadata| (file.dev(), file.ino());
        let own = identity(self.file.metadata().ok()?);
        let is_own = |path: &PathBuf| path.symlink_metadata().is_ok_and(|there| identity(there) == own);
        let renamed = || fs::read_link(self.by_descriptor()).ok().filter(is_own);
        Some(self.part.clone()).filter(is_own).or_else(renamed)
    }

    /// The name that the system gives to the open file.
    fn by_descriptor(&self) -> String {
        format!("/proc/self/fd/{}", self.file.as_raw_fd())
    }

    /// Keeps what is not whole by the name that [`keep_incomplete`] gives it, and tells where it is then: by its hidden name, if
    /// it cannot be renamed. One that was removed is copied to the nearest folder that is left.
    ///
    /// # Errors
    /// It was removed, and cannot be copied: it is lost.
    pub fn keep_incomplete(mut self) -> io::Result<PathBuf> {
        // From here on it is never removed, not even if it cannot be synced or renamed.
        self.open = false;
        let _ = self.file.sync_all();
        let Some(part) = self.whereabouts() else { return self.copy_incomplete() };
        let path = match part == self.part {
            true => self.path.clone(),
            false => part.with_file_name(self.path.file_name().unwrap_or_default()),
        };
        Ok(keep_incomplete(&part, &path).unwrap_or(part))
    }

    /// Copies the file to the nearest folder that is left: the system gives no name back to a file that has lost its last one.
    fn copy_incomplete(&self) -> io::Result<PathBuf> {
        let (folder, name) = split(&self.path)?;
        let folder = std::path::absolute(folder)?;
        let left = folder.ancestors().find(|folder| folder.is_dir()).unwrap_or(Path::new("/"));
        let copy = Self::create(&left.join(name))?;
        // Before it, as it may take long.
        tracing::warn!("{} was removed: what there is of it is copied to {}", self.path.display(), left.display());
        io::copy(&mut File::open(self.by_descriptor())?, &mut copy.file())?;
        copy.keep_incomplete()
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        if let Some(part) = self.open.then(|| self.whereabouts()).flatten() {
            // Nobody is left to tell that it cannot be removed.
            let _ = fs::remove_file(part);
        }
    }
}

/// Writes a file in one go; with `replace`, as for [`Part::commit`].
///
/// # Errors
/// As for [`Part::create`] and [`Part::commit`], or it cannot be written.
pub fn write(path: &Path, bytes: &[u8], replace: bool) -> io::Result<()> {
    let part = Part::create(path)?;
    part.file().write_all(bytes)?;
    part.commit(replace)
}

/// Renames a file or folder within one file system; without `replace`, never over something that exists.
///
/// # Errors
/// [`ErrorKind::AlreadyExists`] without `replace`, or what the system says.
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

/// Renames what was begun as `part` to `NAME.incomplete.mp4` (or whatever its ending is: a player opens it then), to
/// `NAME.incomplete` without one, or to `NAME.incomplete.2.mp4` and on where that is taken.
///
/// # Errors
/// What the system says.
pub fn keep_incomplete(part: &Path, path: &Path) -> io::Result<PathBuf> {
    // A folder's name has no ending, whatever dots are in it.
    let ending = path.extension().filter(|_| !part.is_dir());
    let stem = if ending.is_some() { path.file_stem() } else { path.file_name() };
    for number in 1.. {
        let mut kept = stem.unwrap_or_default().to_owned();
        kept.push(if number == 1 { ".incomplete".into() } else { format!(".incomplete.{number}") });
        if let Some(ending) = ending {
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

/// Bytes that this process has written of a file that will be at `path`; `None` where it writes none.
pub fn bytes_so_far(path: &Path) -> Option<u64> {
    let (folder, name) = split(path).ok()?;
    let own = format!(".{}-", std::process::id());
    let parts = fs::read_dir(folder).ok()?.flatten().filter(|entry| {
        let part = entry.file_name();
        name_of_part(&part) == Some(name) && part.to_string_lossy().contains(&own)
    });
    parts.filter_map(|part| part.metadata().ok()).map(|part| part.len()).max()
}

/// The parts of `path` whose process is gone. None is locked any more, so who calls this may remove or keep them.
///
/// # Errors
/// The folder cannot be read.
pub fn left_behind(path: &Path) -> io::Result<Vec<PathBuf>> {
    let (folder, name) = split(path)?;
    let all = all_left_behind(folder)?.into_iter();
    Ok(all.filter(|(_, of)| of == name).map(|(part, _)| part).collect())
}

/// All parts in a folder whose process is gone, each with the name that it would have had in the end.
///
/// # Errors
/// The folder cannot be read.
pub fn all_left_behind(folder: &Path) -> io::Result<Vec<(PathBuf, OsString)>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name();
        let Some(final_name) = name_of_part(&name).filter(|_| entry.file_type().is_ok_and(|kind| kind.is_file()))
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

/// Syncs the folder of `path`, so that the file's name is safely on the disk, too.
pub(super) fn sync_folder(path: &Path) -> io::Result<()> {
    let (folder, _) = split(path)?;
    // Not every file system syncs folders; the file itself is on the disk.
    let _ = File::open(folder)?.sync_all();
    Ok(())
}

/// Folder and file name.
fn split(path: &Path) -> io::Result<(&Path, &OsStr)> {
    let name = path.file_name().ok_or_else(|| io::Error::new(ErrorKind::InvalidInput, "this names no file"))?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Ok((folder, name))
}

/// `.NAME.PROCESS-NUMBER.part`
fn part_name(name: &OsStr) -> OsString {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let mut part = OsString::from(".");
    part.push(name);
    part.push(format!(".{}-{}{SUFFIX}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed)));
    part
}

/// The name that a part will have in the end; `None` if the name is not of the form of [`part_name`].
fn name_of_part(part: &OsStr) -> Option<&OsStr> {
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
