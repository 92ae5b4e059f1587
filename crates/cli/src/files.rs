//! Output files: overwrite protection, and atomic writing.

use std::collections::BTreeSet;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use super::error::CliError;
use super::log;
use bokehcam_files::input::find_special_file_kind;
use bokehcam_files::{atomic_file, place};
use bokehcam_media::recording::still::{self, PhotoFormat};

/// Returns the picture format for the name of a result, the value of the option `what`.
///
/// # Errors
/// [`CliError::Usage`] if the extension is that of no format.
pub fn check_picture_name(what: &str, path: &Path) -> Result<PhotoFormat, CliError> {
    still::photo_format(path).map_err(|error| CliError::Usage(format!("{what} {error}")))
}

/// Refuses to replace files without `--force`.
///
/// # Errors
/// [`CliError::Exists`] if one of `paths` exists and `force` is not set; [`CliError::Usage`] if it is not a file.
pub fn refuse_overwrite<'a>(paths: impl IntoIterator<Item = &'a Path>, force: bool) -> Result<(), CliError> {
    for path in paths {
        if let Some(what) = find_special_file_kind(path) {
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

/// Refuses to overwrite an input, also through links.
///
/// # Errors
/// [`CliError::Usage`] if `target`, the value of the option `what`, is `source`, lies in it, or contains it.
pub fn refuse_overwriting_source(what: &str, target: &Path, source: &Path) -> Result<(), CliError> {
    if !place::paths_overlap(target, source) {
        return Ok(());
    }
    let [to, from] = [target, source].map(place::resolve_links);
    let how = match () {
        () if to == from => "this is",
        () if to.starts_with(&from) => "this lies in",
        () if from.starts_with(&to) => "this contains",
        () => "this is another name of",
    };
    let (target, source) = (target.display(), source.display());
    Err(CliError::Usage(format!("{what} {target}: {how} {source}, which is the input; choose another place")))
}

/// Writes a file atomically; `replace` allows an existing one.
///
/// # Errors
/// [`CliError::Exists`] if the file exists without `replace`; [`CliError::Io`] if it cannot be written.
pub fn write_atomically(path: &Path, bytes: &[u8], replace: bool) -> Result<(), CliError> {
    atomic_file::write(path, bytes, replace).map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists => CliError::Exists(path.to_owned()),
        _ => CliError::io(path)(error),
    })
}

/// Creates the parent folder of `path`.
///
/// # Errors
/// [`CliError::Io`] if it cannot be created.
pub fn create_parent_folder(path: &Path) -> Result<(), CliError> {
    path.parent().map_or(Ok(()), |folder| fs::create_dir_all(folder).map_err(CliError::io(folder)))
}

/// Warns of hidden files that killed runs left in the folders of `paths`. Removing them is left to the user: where
/// machines share a folder but not its locks, another run may still be writing one.
pub fn warn_of_leftovers<'a>(paths: impl IntoIterator<Item = &'a Path>) {
    let folder_of = |path: &'a Path| match path.parent() {
        _ if path.is_dir() => path,
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let folders: BTreeSet<&Path> = paths.into_iter().map(folder_of).collect();
    for folder in folders {
        let left = atomic_file::find_all_abandoned(folder).unwrap_or_default();
        let names: Vec<String> = left.iter().take(3).map(|(part, _)| part.display().to_string()).collect();
        if !names.is_empty() {
            let more = left.len() - names.len();
            let more = if more == 0 { String::new() } else { format!(" and {more} more") };
            log::warn(&format!(
                "killed runs left hidden files: {}{more}; rename those that you want to keep, and remove the rest",
                names.join(", ")
            ));
        }
    }
}
