//! What `stream` and `preview` have in common for those who control them.

use crate::cli::error::CliError;
use crate::control::{self, Answer, Claim, ControlError, Name};

/// Takes a name for a run. Without a folder for sockets the run goes on, and the inner error is the line that says so,
/// once nothing else is in its way.
///
/// # Errors
/// The name that it was given is taken.
pub fn claim(name: Option<&Name>, command: &'static str) -> Result<Result<Claim, String>, CliError> {
    match control::claim(name, command) {
        Ok(claim) => Ok(Ok(claim)),
        Err(ControlError::NoFolder(why)) => Ok(Err(format!("`bokehcam ctl` cannot reach this {command}: {why}"))),
        Err(error) => Err(CliError::Usage(error.to_string())),
    }
}

/// The answer to what cannot be done.
pub fn refused(error: &CliError) -> Answer {
    match error {
        CliError::Exists(path) => Answer::failed(format!("{} exists: choose another name", path.display())),
        error if error.is_wrong_argument() => Answer::usage(error.to_string()),
        error => Answer::failed(error.to_string()),
    }
}
