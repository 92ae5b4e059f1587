//! `doctor`: what this machine has and lacks for a camera in, a virtual camera out.

#[cfg(feature = "camera")]
mod cameras;
#[cfg(feature = "camera")]
mod computing;
#[cfg(feature = "camera")]
mod finding;
#[cfg(feature = "camera")]
mod findings;
#[cfg(feature = "camera")]
mod loopback;
#[cfg(all(feature = "camera", feature = "pipewire"))]
mod pipewire_camera;
#[cfg(feature = "camera")]
mod system;

use clap::Args;

use crate::cli::error::CliError;

/// Check this machine: cameras, virtual camera, permissions, GPU, programs
///
/// Every finding comes with what to do about it. Good to have in a request for help. The exit code is 0 when there are
/// a camera and a way to give others one (the module v4l2loopback, or PipeWire), else 1.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  bokehcam doctor
  bokehcam doctor --json > doctor.json")]
#[cfg_attr(not(feature = "camera"), allow(dead_code))]
pub struct DoctorCommand {
    /// As JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// Something essential is missing, or this program was built without cameras.
pub fn run(command: &DoctorCommand) -> Result<(), CliError> {
    #[cfg(feature = "camera")]
    return findings::run(command.json);
    #[cfg(not(feature = "camera"))]
    {
        let _ = command;
        Err(CliError::NoCameras)
    }
}
