//! Files that appear whole or not at all.

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;

use super::error::CliError;
use crate::files::place;
use crate::stats::Report;

/// # Errors
/// [`CliError::Exists`] when one of `paths` exists and `force` is not given.
pub fn refuse_overwrite<'a>(paths: impl IntoIterator<Item = &'a Path>, force: bool) -> Result<(), CliError> {
    match paths.into_iter().find(|path| !force && path.symlink_metadata().is_ok()) {
        Some(path) => Err(CliError::Exists(path.to_owned())),
        None => Ok(()),
    }
}

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

/// Writes a file under another name in the same folder, and then gives it its own; what was there gives its permissions.
///
/// # Errors
/// [`CliError::Io`] when the folder cannot be written.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), CliError> {
    let mut part = path.as_os_str().to_owned();
    part.push(format!(".{}.part", std::process::id()));
    let part = Path::new(&part);
    let written = File::create(part).and_then(|mut file| {
        if let Ok(there) = fs::metadata(path) {
            file.set_permissions(there.permissions())?;
        }
        file.write_all(bytes)?;
        file.sync_all()
    });
    written.and_then(|()| fs::rename(part, path)).map_err(|error| {
        // The first failure is the one to tell.
        let _ = fs::remove_file(part);
        CliError::io(path)(error)
    })
}

/// Writes the report of a run as JSON.
///
/// # Errors
/// As for [`write_whole`].
pub fn write_report(path: &Path, report: &Report) -> Result<(), CliError> {
    let mut json = Vec::new();
    report.write_json(&mut json).map_err(CliError::io(path))?;
    write_whole(path, &json)
}
