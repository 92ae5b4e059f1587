//! Cameras that PipeWire shares between programs.

use std::fmt::Write as _;

use serde::Serialize;

use crate::error::CliError;
use bokehcam_live::v4l2::modes::FormatModes;

/// A PipeWire camera.
#[derive(Serialize)]
pub struct PipewireCamera {
    /// Source name on the command line, `pipewire:NAME`.
    pub name: String,
    /// Human-readable name.
    pub label: String,
    pub formats: Vec<FormatModes>,
}

/// Lists all cameras of PipeWire; empty if PipeWire is not running.
#[cfg(feature = "pipewire")]
pub fn list_cameras() -> Vec<PipewireCamera> {
    use bokehcam_live::capture::pipewire::format_modes;
    use bokehcam_live::pipewire::graph::Graph;
    let graph = Graph::list_with_modes().unwrap_or_else(|error| {
        tracing::info!("{error}");
        Graph::default()
    });
    let cameras = graph.sources.into_iter().filter(|source| source.is_camera);
    let camera = cameras.map(|source| PipewireCamera {
        name: format!("pipewire:{}", source.name),
        label: source.label,
        formats: source.modes.iter().map(format_modes).collect(),
    });
    camera.collect()
}

/// Returns an empty list: this program was built without PipeWire.
#[cfg(not(feature = "pipewire"))]
pub fn list_cameras() -> Vec<PipewireCamera> {
    Vec::new()
}

/// Finds cameras whose name or label contains `name`, the text after `pipewire:`.
///
/// # Errors
/// [`CliError::NoPipeWireCamera`] if none matches.
pub fn find_cameras(name: &str) -> Result<Vec<PipewireCamera>, CliError> {
    let wanted = name.to_lowercase();
    let is_match = |camera: &PipewireCamera| {
        [&camera.name["pipewire:".len()..], &camera.label].into_iter().any(|text| text.to_lowercase().contains(&wanted))
    };
    let found: Vec<PipewireCamera> = list_cameras().into_iter().filter(is_match).collect();
    match found.is_empty() {
        true => Err(CliError::NoPipeWireCamera(name.to_owned())),
        false => Ok(found),
    }
}

impl PipewireCamera {
    /// Formats the camera as a line of names, then indented its formats.
    pub fn lines(&self) -> String {
        let mut out = format!("  {}  {}\n", self.name, self.label);
        for format in &self.formats {
            // Writing to a string cannot fail.
            let _ = writeln!(out, "    {:4}  {}", format.fourcc.to_string(), format.sizes);
        }
        out
    }
}
