//! `devices`: lists cameras, their formats and controls.

#[cfg(feature = "camera")]
mod list;
#[cfg(feature = "camera")]
mod pipewire_cameras;

use clap::Args;

use crate::error::CliError;
use crate::options::Global;
#[cfg(feature = "camera")]
use bokehcam_live::v4l2::node::Node;

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
#[cfg_attr(not(feature = "camera"), allow(dead_code))]
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

/// Formats cameras, and nodes that may be cameras, as the command lists them; without links, whose names contain serial
/// numbers.
#[cfg(feature = "camera")]
pub fn format_devices(nodes: &[Node]) -> String {
    list::format_devices(nodes)
}

/// Runs the command.
///
/// # Errors
/// Fails if no device matches, or this program was built without cameras.
pub fn run(command: &DevicesCommand, global: &Global) -> Result<(), CliError> {
    #[cfg(feature = "camera")]
    return list::run(command, global);
    #[cfg(not(feature = "camera"))]
    {
        let _ = (command, global);
        Err(CliError::NoCameras)
    }
}
