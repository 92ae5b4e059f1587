//! Output files: what may be overwritten, and writing them whole or not at all.

use std::collections::BTreeSet;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use super::error::CliError;
use super::log;
use bokehcam::files::input::no_file_at;
use bokehcam::files::{place, whole};

/// Refuses to replace files, unless with `--force`.
///
/// # Errors
/// [`CliError::Exists`] when one of `paths` exists and `force` is not given; [`CliError::Usage`] when it is no file.
pub fn refuse_overwrite<'a>(paths: impl IntoIterator<Item = &'a Path>, force: bool) -> Result<(), CliError> {
    for path in paths {
        if let Some(what) = no_file_at(path) {
            return Err(CliError::Usage(format!(
                "{} is {what}, and is not replaced by a file; choose another name",
                path.display()
            )));
        }
        if !force && path.symlink_metadata().is_ok() {
            return Err(CliError::Exists(path.to_owned()));
        }
    }
    Ok(())
}

/// Refuses to write over what is read, whatever links lead there.
///
/// # Errors
/// [`CliError::Usage`] when `target`, which the option `what` names, is `source`, lies in it, or holds it.
pub fn refuse_source(what: &str, target: &Path, source: &Path) -> Result<(), CliError> {
    if !place::overlap(target, source) {
        return Ok(());
    }
    let [to, from] = [target, source].map(place::resolved);
    let how = match (to == from, to.starts_with(&from)) {
        (true, _) => "this is",
        (_, true) => "this lies in",
        _ => "this holds",
    };
    let (target, source) = (target.display(), source.display());
    Err(CliError::Usage(format!("{what} {target}: {how} {source}, which is read; choose another place")))
}

/// Writes a file whole; with `replace`, in place of what is there.
///
/// # Errors
/// [`CliError::Exists`] where something is there, without `replace`; [`CliError::Io`] when the folder cannot be written.
pub fn write_whole(path: &Path, bytes: &[u8], replace: bool) -> Result<(), CliError> {
    whole::write(path, bytes, replace).map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists => CliError::Exists(path.to_owned()),
        _ => CliError::io(path)(error),
    })
}

/// Makes the folder that `path` is to be in.
///
/// # Errors
/// [`CliError::Io`] when it cannot be made.
pub fn make_folder_of(path: &Path) -> Result<(), CliError> {
    match path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        Some(folder) => fs::create_dir_all(folder).map_err(CliError::io(folder)),
        None => Ok(()),
    }
}

/// Says what runs that were killed left hidden in the folders of `paths`. It is left to the user: where nodes share a
/// folder and not its locks, a file that seems to be left behind may be one that another run is writing.
pub fn tell_of_leftovers<'a>(paths: impl IntoIterator<Item = &'a Path>) {
    let folder_of = |path: &'a Path| match path.parent() {
        _ if path.is_dir() => path,
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let folders: BTreeSet<&Path> = paths.into_iter().map(folder_of).collect();
    for folder in folders {
        let left = whole::all_left_behind(folder).unwrap_or_default();
        let names: Vec<String> = left.iter().take(3).map(|(part, _)| part.display().to_string()).collect();
        if !names.is_empty() {
            let more = left.len() - names.len();
            let more = if more == 0 { String::new() } else { format!(" and {more} more") };
            log::warn(&format!(
                "runs that were killed left hidden files: {}{more}; give those that you want another name, and remove the rest",
                names.join(", ")
            ));
        }
    }
}
