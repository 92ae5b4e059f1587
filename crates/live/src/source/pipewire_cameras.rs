//! Cameras of PipeWire: their names, and how they are opened.

use super::cameras::mode_request;
use super::devices::Choice;
use super::{Frames, SourceError, SourceName};
use crate::capture::Camera;
use crate::capture::pipewire::PipeWireCamera;
use crate::pipewire::graph::{Graph, Source};
use crate::pipewire::is_available;
pub use crate::pipewire::watch::SourceWatch;

/// Parses the name after `pipewire:`; its existence is checked when it is opened.
pub fn parse(name: &str) -> Result<SourceName, SourceError> {
    match name.is_empty() {
        true => SourceError::usage_error("pipewire:NAME needs the name of a camera; `bokehcam devices` lists them"),
        false => Ok(SourceName::PipeWire(name.to_owned())),
    }
}

/// Opens a camera, as the target of a filter if `filters`.
pub fn open(name: &str, filters: bool, frames: &Frames) -> Result<Box<dyn Camera>, SourceError> {
    if let Some((control, value)) = frames.control.first() {
        let what = format!("--control {control}={value}: a PipeWire camera has no controls; use its /dev/videoN");
        return SourceError::usage_error(what);
    }
    Ok(Box::new(PipeWireCamera::open(name, filters, mode_request(frames), frames.frames)?))
}

/// Returns the cameras that only PipeWire has, without this program's own and those of
/// [`list_cameras`](super::devices::list_cameras).
pub fn list_pipewire_cameras() -> Vec<Choice> {
    let graph = Graph::list_without_modes().unwrap_or_default();
    let is_other = |source: &Source| source.is_camera && !source.is_ours() && !source.name.starts_with("v4l2_");
    let choice = |source: Source| Choice { name: format!("pipewire:{}", source.name), label: source.label };
    graph.sources.into_iter().filter(is_other).map(choice).collect()
}

/// Returns the camera that this program would offer in PipeWire, if PipeWire runs.
pub fn find_output() -> Option<Choice> {
    is_available().then(|| Choice { name: "pipewire".to_owned(), label: "bokehcam (PipeWire)".to_owned() })
}

/// Watches for cameras that come and go, if PipeWire runs.
pub fn watch() -> Option<SourceWatch> {
    SourceWatch::new().inspect_err(|error| tracing::debug!("cameras of PipeWire are not watched: {error}")).ok()
}
