//! Helpers of all benches.

use std::process::ExitCode;

/// Returns the parsed options, or the exit code after printing help or a one-line error.
pub fn options<O: clap::Parser>() -> Result<O, ExitCode> {
    match O::try_parse() {
        Ok(options) => Ok(options),
        Err(error) if error.use_stderr() => {
            eprintln!("{}", error.to_string().lines().next().unwrap_or("error: bad options"));
            Err(ExitCode::from(2))
        }
        Err(help) => help.exit(),
    }
}
