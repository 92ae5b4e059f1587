//! This program as the process that runs a network for another one of it.

use std::ffi::OsString;
use std::process::ExitCode;

use bokehcam::network::apart;

/// Whether it was started for that.
pub fn is_asked_for(args: &[OsString]) -> bool {
    matches!(args, [_, argument] if argument == apart::ARGUMENT)
}

/// Runs the network until nobody wants its answers.
pub fn serve() -> ExitCode {
    // A signal is for the program that waits for the answers: this one ends with it.
    let ignored = ctrlc::set_handler(|| {}).is_ok();
    match apart::serve() {
        Ok(()) if ignored => ExitCode::SUCCESS,
        _ => ExitCode::FAILURE,
    }
}
