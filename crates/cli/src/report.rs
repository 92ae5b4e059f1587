//! The report of a run: its path, and the fallback if it cannot be written there.

use std::io::{ErrorKind, Write};
use std::path::Path;

use super::error::CliError;
use super::files::{create_parent_folder, refuse_overwrite};
use super::terminal::{print_to_stderr, print_to_stdout};
use bokehcam_files::atomic_file::PartFile;
use bokehcam_files::place;
use bokehcam_live::sink::Target;
use bokehcam_live::stats::Report;

/// Path that stands for standard output.
const STDOUT: &str = "-";

/// Checks before a run that its report may be written to `path`, next to the outputs `targets`.
///
/// # Errors
/// Fails if `path` exists without `force` or is not a report, or if one of `targets` writes there, too.
pub fn check_path(path: Option<&Path>, force: bool, targets: &[Target]) -> Result<(), CliError> {
    let usage = |text: String| Err(CliError::Usage(text));
    let Some(path) = path.filter(|path| *path != STDOUT) else {
        return match path.is_some() && targets.contains(&Target::Stdout) {
            true => usage("--report - and --to - both use standard output; name a file for one of them".into()),
            false => Ok(()),
        };
    };
    for target in targets.iter().filter(|target| !target.is_camera()) {
        let Some(place) = target.path().filter(|place| place::paths_overlap(place, path)) else { continue };
        let what = match place::resolve_links(place) == place::resolve_links(path) {
            true => format!("--to {target} writes to it, too; name another file"),
            false => format!("that folder is for the pictures of --to {target}; choose another folder"),
        };
        return usage(format!("--report {}: {what}", path.display()));
    }
    refuse_overwrite([path], force)?;
    let is_json = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"));
    if is_json || !path.exists() {
        return Ok(());
    }
    usage(format!(
        "--report {}: this exists and is not a report; --force only replaces .json files, so choose another name",
        path.display()
    ))
}

/// Checks before a run that its report can be written; creates its folder.
///
/// # Errors
/// Fails if its folder cannot be created or written.
pub fn check_writable(path: Option<&Path>) -> Result<(), CliError> {
    match path {
        // Uses a part file next to it: opening the path itself would disturb the reader of a pipe.
        Some(path) if path != STDOUT => {
            create_parent_folder(path)?;
            PartFile::create(path).map(drop).map_err(CliError::io(path))
        }
        _ => Ok(()),
    }
}

/// Writes the report of a run as JSON, to standard output if `path` is `-`. A file created there during the run is kept
/// without `force`; the report is then kept as `NAME.incomplete`. If nothing can be written, it is printed to the
/// terminal.
///
/// # Errors
/// Fails if the report is not at `path`.
pub fn write_report(path: &Path, report: &Report, force: bool) -> Result<(), CliError> {
    let mut json = Vec::new();
    report.write_json(&mut json).map_err(CliError::io(path))?;
    if path == STDOUT {
        return print_to_stdout(&json);
    }
    let to_error = |cause: std::io::Error| match cause.kind() {
        ErrorKind::AlreadyExists => CliError::Exists(path.to_owned()),
        _ => CliError::io(path)(cause),
    };
    let written = PartFile::create(path).and_then(|part| part.file().write_all(&json).map(|()| part));
    let error = match written {
        Ok(mut part) => match part.try_commit(force) {
            Ok(()) => return Ok(()),
            Err(cause) => match part.keep_incomplete() {
                Ok(kept) => return Err(CliError::ReportKept { error: Box::new(to_error(cause)), kept }),
                Err(_) => to_error(cause),
            },
        },
        Err(cause) => to_error(cause),
    };
    print_to_stderr(&format!("the report could not be saved; here it is:\n{}", String::from_utf8_lossy(&json)));
    Err(error)
}
