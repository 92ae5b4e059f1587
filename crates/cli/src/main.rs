//! The program: runs the command line of this library.

use std::process::ExitCode;

fn main() -> ExitCode {
    bokehcam_cli::run(std::env::args_os())
}
