//! Files that appear under their name only when they are whole: written beside it, synced, then renamed.
//!
//! The part file is hidden, has a name that no other process uses, is never opened through a link, and is locked while
//! it is being written: one that can be locked was left behind by a process that died.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::os::unix::ffi::OsStrExt;
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

    /// Keeps what is not whole as `NAME.incomplete`, or `NAME.incomplete.2` and on where that is taken; gives the name.
    ///
    /// # Errors
    /// What the system says. The part is then left where it is.
    pub fn keep_incomplete(mut self) -> io::Result<PathBuf> {
        // From here on it is never removed, not even if it cannot be synced or renamed.
        self.open = false;
        let _ = self.file.sync_all();
        keep_incomplete(&self.part, &self.path)
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        if self.open {
            // Nobody is left to tell that it cannot be removed.
            let _ = fs::remove_file(&self.part);
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

/// Renames what was begun as `part` to `NAME.incomplete`, or `NAME.incomplete.2` and on where that is taken.
///
/// # Errors
/// What the system says.
pub fn keep_incomplete(part: &Path, path: &Path) -> io::Result<PathBuf> {
    for number in 1.. {
        let mut kept = path.as_os_str().to_owned();
        kept.push(if number == 1 { ".incomplete".into() } else { format!(".incomplete.{number}") });
        let kept = PathBuf::from(kept);
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
mod tests {
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;

    fn names(dir: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_appears_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        let part = Part::create(&path).unwrap();
        part.file().write_all(b"one").unwrap();
        assert!(!path.exists());
        assert_eq!((bytes_so_far(&path), bytes_so_far(&dir.path().join("b.txt"))), (Some(3), None));
        drop(part);
        assert_eq!(bytes_so_far(&path), None);
        assert_eq!(names(dir.path()), Vec::<String>::new());

        write(&path, b"one", false).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).unwrap();
        assert_eq!(write(&path, b"two", false).unwrap_err().kind(), ErrorKind::AlreadyExists);
        assert_eq!(fs::read(&path).unwrap(), b"one");
        write(&path, b"two", true).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(names(dir.path()), ["a.txt"]);
    }

    #[test]
    fn two_writers_of_one_name_never_mix() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.y4m");
        let (one, two) = (Part::create(&path).unwrap(), Part::create(&path).unwrap());
        one.file().write_all(b"one").unwrap();
        two.file().write_all(b"two").unwrap();
        one.commit(false).unwrap();
        assert_eq!(two.commit(false).unwrap_err().kind(), ErrorKind::AlreadyExists);
        assert_eq!((names(dir.path()), fs::read(&path).unwrap()), (vec!["a.y4m".to_owned()], b"one".to_vec()));
    }

    #[test]
    fn parts_left_behind_are_found_and_no_others() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.mkv");
        let alive = Part::create(&path).unwrap();
        let left = dir.path().join(".a.mkv.77-0.part");
        let foreign = [".a.mkv.part", ".a.mkv.7.part", ".a.mkv.x-1.part", ".b.mkv.7-1.part", "a.mkv.7-1.part"];
        fs::write(&left, "take").unwrap();
        for name in foreign {
            fs::write(dir.path().join(name), "").unwrap();
        }
        symlink(dir.path().join("b"), dir.path().join(".a.mkv.8-0.part")).unwrap();
        assert_eq!(left_behind(&path).unwrap(), std::slice::from_ref(&left));
        let kept = keep_incomplete(&left, &path).unwrap();
        assert_eq!(kept, dir.path().join("a.mkv.incomplete"));
        alive.file().write_all(b"more").unwrap();
        assert_eq!(alive.keep_incomplete().unwrap(), dir.path().join("a.mkv.incomplete.2"));
        assert_eq!(fs::read(dir.path().join("a.mkv.incomplete")).unwrap(), b"take");
    }

    #[test]
    fn a_link_in_the_way_is_never_written_through() {
        let dir = tempfile::tempdir().unwrap();
        let victim = dir.path().join("victim");
        fs::write(&victim, "mine").unwrap();
        let path = dir.path().join("a.png");
        symlink(&victim, &path).unwrap();
        assert_eq!(write(&path, b"new", false).unwrap_err().kind(), ErrorKind::AlreadyExists);
        write(&path, b"new", true).unwrap();
        assert_eq!((fs::read(&victim).unwrap(), fs::read(&path).unwrap()), (b"mine".to_vec(), b"new".to_vec()));
    }
}
