//! Cameras that PipeWire has, for whoever asks.

use std::fmt::Write as _;

use serde::Serialize;

use crate::error::CliError;
use bokehcam::v4l2::modes::FormatModes;

/// A camera of PipeWire's.
#[derive(Serialize)]
pub struct SharedCamera {
    /// As the command line calls it.
    pub name: String,
    /// As people call it.
    pub label: String,
    pub formats: Vec<FormatModes>,
}

/// All of them; none where there is no PipeWire.
#[cfg(feature = "pipewire")]
pub fn all() -> Vec<SharedCamera> {
    use bokehcam::capture::pipewire::format_modes;
    use bokehcam::pipewire::graph::Graph;
    let graph = Graph::look_closely().unwrap_or_else(|error| {
        tracing::info!("{error}");
        Graph::default()
    });
    let cameras = graph.sources.into_iter().filter(|source| source.is_camera);
    let camera = cameras.map(|source| SharedCamera {
        name: format!("pipewire:{}", source.name),
        label: source.label,
        formats: source.modes.iter().map(format_modes).collect(),
    });
    camera.collect()
}

/// All of them: this program was built without PipeWire.
#[cfg(not(feature = "pipewire"))]
pub fn all() -> Vec<SharedCamera> {
    Vec::new()
}

/// Those that `name`, which follows `pipewire:`, means or is a part of.
///
/// # Errors
/// There is none.
pub fn named(name: &str) -> Result<Vec<SharedCamera>, CliError> {
    let wanted = name.to_lowercase();
    let is_meant = |camera: &SharedCamera| {
        [&camera.name["pipewire:".len()..], &camera.label].into_iter().any(|text| text.to_lowercase().contains(&wanted))
    };
    let found: Vec<SharedCamera> = all().into_iter().filter(is_meant).collect();
    match found.is_empty() {
        true => Err(CliError::NoShared(name.to_owned())),
        false => Ok(found),
    }
}

impl SharedCamera {
    /// The camera for people: a line of names, then indented its formats.
    pub fn lines(&self) -> String {
        let mut out = format!("  {}  {}\n", self.name, self.label);
        for format in &self.formats {
            // Writing to a string does not fail.
            let _ = writeln!(out, "    {:4}  {}", format.fourcc.to_string(), format.sizes);
        }
        out
    }
}
