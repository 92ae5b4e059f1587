//! The program: runs the command line of this library.

use std::process::ExitCode;

use bokehcam::compute::memory_limit::LimitedAllocator;

/// Keeps unknown networks within their memory.
#[global_allocator]
static ALLOCATOR: LimitedAllocator = LimitedAllocator;

fn main() -> ExitCode {
    bokehcam_cli::run(std::env::args_os())
}
