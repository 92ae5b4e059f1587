//! What `stream` and `preview` have in common for those who control them.

use crate::cli::error::CliError;
use crate::cli::options::Global;
use crate::cli::terminal;
use crate::control::{self, Answer, Claim, ControlError, Name};

/// How a run can be controlled.
pub struct Wish<'a> {
    /// The name that it was given.
    pub name: Option<&'a Name>,
    /// The command.
    pub command: &'static str,
    /// Whether somebody may want to control it, although it was given no name.
    pub is_live: bool,
}

/// Takes a name for a run, and says where that cannot be; the run goes on without.
///
/// # Errors
/// The name that it was given is taken.
pub fn claim(wish: &Wish, global: &Global) -> Result<Option<Claim>, CliError> {
    match control::claim(wish.name, wish.command) {
        Ok(claim) => Ok(Some(claim)),
        Err(ControlError::NoFolder(why)) => {
            if !global.quiet && (wish.is_live || wish.name.is_some()) {
                terminal::say(&format!("`bokehcam ctl` cannot reach this {}: {why}", wish.command));
            }
            Ok(None)
        }
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
