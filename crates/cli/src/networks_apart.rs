//! This program as the worker process that runs a network for another instance.

use std::ffi::OsString;
use std::process::ExitCode;

use bokehcam::network::isolation;

/// Whether the arguments start the worker process.
pub fn is_worker_call(args: &[OsString]) -> bool {
    matches!(args, [_, argument] if argument == isolation::ARGUMENT)
}

/// Runs the network until the parent process stops reading.
pub fn serve() -> ExitCode {
    // Signals are for the parent process: this one ends with it.
    let ignored = ctrlc::set_handler(|| {}).is_ok();
    match isolation::serve() {
        Ok(()) if ignored => ExitCode::SUCCESS,
        _ => ExitCode::FAILURE,
    }
}
