//! The cameras of a build without the feature `camera`: there are none.

use super::devices::Choice;
use super::modes::Mode;
use super::name::{NamedCamera, accepted_sources, is_file_name, missing_path_error};
use super::{Frames, SourceError, SourceName, options};
use crate::camera_control::CameraControl;
use crate::capture::Camera;
use bokehcam::clock::Clock;
use bokehcam::depth::DepthSource;
use bokehcam::depth::plate::CameraLock;

const WHAT: &str = "this build leaves cameras out (feature `camera`)";

pub fn parse(text: &str) -> Result<SourceName, SourceError> {
    Err(match text.starts_with("/dev/") || text.parse::<u32>().is_ok() {
        true => SourceError::Usage(format!("{WHAT}: use {}", accepted_sources())),
        false if is_file_name(text) => missing_path_error(text),
        false => SourceError::NotFound(format!("there is no such folder, and {WHAT}: use {}", accepted_sources())),
    })
}

pub fn open(_: &NamedCamera, _: &Frames) -> Result<Box<dyn Camera>, SourceError> {
    SourceError::usage_error(WHAT)
}

pub fn open_pair(_: &[NamedCamera; 2], _: &Frames) -> Result<Box<dyn Camera>, SourceError> {
    SourceError::usage_error(WHAT)
}

pub fn open_depth_camera(name: &str, _: &options::Depth, _: &Clock) -> Result<Box<dyn DepthSource>, SourceError> {
    Err(SourceError::NotFound(format!(
        "--depth {name}: there is no such folder, and this build leaves cameras out (feature `camera`)"
    )))
}

pub fn create_lock(_: String) -> Option<CameraLock> {
    None
}

/// Returns none.
pub fn list_cameras() -> Vec<Choice> {
    Vec::new()
}

pub use list_cameras as list_virtual_cameras;

/// Returns none.
pub fn list_controls(_: &str) -> Vec<CameraControl> {
    Vec::new()
}

/// Fails.
///
/// # Errors
/// Always.
pub fn set_control(camera: &str, control: &str, value: i64) -> Result<Vec<CameraControl>, String> {
    Err(format!("{camera}: {WHAT}, so {control} cannot be {value}"))
}

/// Returns none.
pub fn list_modes(_: &str) -> Vec<Mode> {
    Vec::new()
}

/// Returns false.
pub fn faces_user(_: &str) -> bool {
    false
}
