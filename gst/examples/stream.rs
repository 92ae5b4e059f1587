//! The program `bokehcam` on this crate's build of the library, for `gst/bench` to compare the element with.

fn main() -> std::process::ExitCode {
    bokehcam_cli::run(std::env::args_os())
}
