//! The report of a run: where it may go, and what becomes of it where it cannot go there.

use std::io::{ErrorKind, Write};
use std::path::Path;

use super::error::CliError;
use super::files::refuse_overwrite;
use super::terminal::{print, say};
use bokehcam::files::place;
use bokehcam::files::whole::Part;
use bokehcam::sink::Target;
use bokehcam::stats::Report;

/// The path that means standard output.
const STDOUT: &str = "-";

/// Checks before a run that its report may be written to `path`, beside what goes to `targets`.
///
/// # Errors
/// Something is there that may not be overwritten, or is no report; or one of `targets` writes there, too.
pub fn check(path: Option<&Path>, force: bool, targets: &[Target]) -> Result<(), CliError> {
    let usage = |text: String| Err(CliError::Usage(text));
    let Some(path) = path.filter(|path| *path != STDOUT) else {
        return match path.is_some() && targets.contains(&Target::Stdout) {
            true => usage("--report - and --to -: standard output takes one of them; name a file for the other".into()),
            false => Ok(()),
        };
    };
    for target in targets.iter().filter(|target| !target.is_camera()) {
        let Some(place) = target.path().filter(|place| place::overlap(place, path)) else { continue };
        let what = match place::resolved(place) == place::resolved(path) {
            true => format!("--to {target} goes there, too; name another file"),
            false => format!("the pictures of --to {target} lie there; choose another folder"),
        };
        return usage(format!("--report {}: {what}", path.display()));
    }
    refuse_overwrite([path], force)?;
    let is_json = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"));
    if is_json || !path.exists() {
        return Ok(());
    }
    usage(format!(
        "--report {}: this exists and is no report; --force replaces files called .json alone, so choose another name",
        path.display()
    ))
}

/// Checks before a run that its report can be written.
///
/// # Errors
/// Its folder cannot be written.
pub fn try_out(path: Option<&Path>) -> Result<(), CliError> {
    match path {
        // With a part file beside it: opening the path itself would disturb the reader of a pipe.
        Some(path) if path != STDOUT => Part::create(path).map(drop).map_err(CliError::io(path)),
        _ => Ok(()),
    }
}

/// Writes the report of a run as JSON, to standard output where `path` is `-`. What has come to its name since the run began
/// stays, unless `force` is given. A report that cannot have its name is kept as `NAME.incomplete`; where nothing can be
/// written, it goes to the terminal.
///
/// # Errors
/// It could not have its name.
pub fn write(path: &Path, report: &Report, force: bool) -> Result<(), CliError> {
    let mut json = Vec::new();
    report.write_json(&mut json).map_err(CliError::io(path))?;
    if path == STDOUT {
        return print(&json);
    }
    let refused = |cause: std::io::Error| match cause.kind() {
        ErrorKind::AlreadyExists => CliError::Exists(path.to_owned()),
        _ => CliError::io(path)(cause),
    };
    let written = Part::create(path).and_then(|part| part.file().write_all(&json).map(|()| part));
    let error = match written {
        Ok(mut part) => match part.try_commit(force) {
            Ok(()) => return Ok(()),
            Err(cause) => match part.keep_incomplete() {
                Ok(kept) => return Err(CliError::ReportKept { error: Box::new(refused(cause)), kept }),
                Err(_) => refused(cause),
            },
        },
        Err(cause) => refused(cause),
    };
    say(&format!("the report has no other place:\n{}", String::from_utf8_lossy(&json)));
    Err(error)
}
