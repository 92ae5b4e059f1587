//! What the benches share.

use std::process::ExitCode;

/// The options that were given, or how to end: help is printed, and what is wrong with them in one line.
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
