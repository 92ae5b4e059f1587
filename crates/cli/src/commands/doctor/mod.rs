//! `doctor`: checks this machine for camera input and virtual camera output.

#[cfg(feature = "camera")]
mod cameras;
mod computing;
mod finding;
#[cfg(feature = "camera")]
mod findings;
mod hardware;
#[cfg(feature = "camera")]
mod loopback;
#[cfg_attr(not(feature = "pipewire"), path = "no_pipewire_camera.rs")]
mod pipewire_camera;
mod private;
#[cfg(feature = "camera")]
mod report;
mod settings;
mod system;
#[cfg(feature = "camera")]
mod trial_run;

use std::path::PathBuf;

use clap::Args;

use crate::error::CliError;
use crate::options::Global;

/// Check this machine: cameras, virtual camera, permissions, GPU, programs, your settings
///
/// Every finding comes with advice. Add the output to a request for help. The exit code is 0 when there are a camera
/// and a way to provide a virtual one (the module v4l2loopback, or PipeWire), else 1; with --report it is 0 if the
/// report was made.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  bokehcam doctor
  bokehcam doctor --json > doctor.json
  bokehcam doctor --report machine.md")]
pub struct DoctorCommand {
    /// As JSON
    #[arg(long)]
    json: bool,
    /// Print a report of this machine to share, and write it to FILE, after a run of ten seconds; without names of users
    /// and machines, serial numbers and pictures
    #[arg(long, value_name = "FILE", num_args = 0..=1, conflicts_with = "json")]
    report: Option<Option<PathBuf>>,
}

/// Runs the command.
///
/// # Errors
/// Fails if something essential is missing, or this program was built without cameras.
pub fn run(command: &DoctorCommand, global: &Global) -> Result<(), CliError> {
    #[cfg(feature = "camera")]
    return match (&command.report, global.config.as_deref()) {
        (Some(file), config) => report::run(file.as_deref(), config),
        (None, config) => findings::run(command.json, config),
    };
    #[cfg(not(feature = "camera"))]
    return Err(CliError::NoCameras);
}
