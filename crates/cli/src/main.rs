//! Arguments in, exit code out.

use std::process::ExitCode;

fn main() -> ExitCode {
    bokehcam_cli::run(std::env::args_os())
}
