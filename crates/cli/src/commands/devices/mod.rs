//! `devices`: lists cameras, their formats and controls.

#[cfg(feature = "camera")]
pub mod list;
#[cfg(feature = "camera")]
mod pipewire_cameras;

use clap::Args;

use crate::error::CliError;
use crate::options::Global;

/// List cameras and virtual cameras
///
/// Cameras with their formats, sizes and rates, and the programs that have them open; then virtual cameras and PipeWire
/// cameras. Nodes without pictures, such as those for metadata, are left out.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  bokehcam devices
  bokehcam devices --controls brio
  bokehcam devices --json /dev/video0")]
pub struct DevicesCommand {
    /// One device only: its path, number, by-id name, or a part of its card's name; pipewire:NAME for a PipeWire camera
    #[arg(value_name = "DEVICE")]
    device: Option<String>,
    /// Also list the device's own settings, such as exposure
    #[arg(long)]
    controls: bool,
    /// As JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// Fails if no device matches, or this program was built without cameras.
pub fn run(command: &DevicesCommand, global: &Global) -> Result<(), CliError> {
    #[cfg(feature = "camera")]
    return list::run(command, global);
    #[cfg(not(feature = "camera"))]
    return Err(CliError::NoCameras);
}
