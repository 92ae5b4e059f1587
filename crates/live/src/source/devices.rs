//! Lists the cameras, virtual cameras and camera controls of this machine. A build without cameras has none.

use super::SourceName;
use crate::camera_control::CameraControl;
#[cfg(feature = "camera")]
use crate::v4l2::{
    live::user_controls,
    node::{self, Kind, Node},
};

/// A device to choose.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Choice {
    /// Its name on the command line.
    pub name: String,
    /// Its name for users.
    pub label: String,
}

/// Maximum length of a label in characters; longer paths are shortened to their end.
const MAX_LABEL_CHARS: usize = 36;

impl Choice {
    /// Creates a choice that is no device: its label is its name, of which a long path keeps the end.
    pub fn from_name(name: &str) -> Self {
        let is_short = |from: &usize| name[*from..].chars().count() < MAX_LABEL_CHARS;
        let cuts = || name.match_indices('/').map(|(at, _)| at).skip(1);
        let end = cuts().find(is_short).or(cuts().last());
        let label = match end.filter(|_| name.chars().count() > MAX_LABEL_CHARS) {
            Some(from) => format!("…{}", &name[from..]),
            None => name.to_owned(),
        };
        Self { name: name.to_owned(), label }
    }
}

/// Returns the cameras.
pub fn list_cameras() -> Vec<Choice> {
    #[cfg(feature = "camera")]
    return list_devices(Kind::Capture);
    #[cfg(not(feature = "camera"))]
    return Vec::new();
}

/// Returns the cameras that only PipeWire has, without this program's own and those of [`list_cameras`].
pub fn list_pipewire_cameras() -> Vec<Choice> {
    #[cfg(feature = "pipewire")]
    {
        let graph = crate::pipewire::graph::Graph::list_without_modes().unwrap_or_default();
        let is_other = |source: &crate::pipewire::graph::Source| {
            source.is_camera && !source.is_ours() && !source.name.starts_with("v4l2_")
        };
        let choice = |source: crate::pipewire::graph::Source| Choice {
            name: format!("pipewire:{}", source.name),
            label: source.label,
        };
        graph.sources.into_iter().filter(is_other).map(choice).collect()
    }
    #[cfg(not(feature = "pipewire"))]
    Vec::new()
}

/// Returns the virtual cameras that could be written to.
pub fn list_virtual_cameras() -> Vec<Choice> {
    #[cfg(feature = "camera")]
    let mut found = list_devices(Kind::Virtual);
    #[cfg(not(feature = "camera"))]
    let mut found = Vec::new();
    found.extend(find_pipewire_output());
    found
}

/// Returns the camera that this program would offer in PipeWire, if PipeWire runs.
fn find_pipewire_output() -> Option<Choice> {
    #[cfg(feature = "pipewire")]
    return crate::pipewire::is_available()
        .then(|| Choice { name: "pipewire".to_owned(), label: "bokehcam (PipeWire)".to_owned() });
    #[cfg(not(feature = "pipewire"))]
    return None;
}

#[cfg(feature = "camera")]
fn list_devices(kind: Kind) -> Vec<Choice> {
    let of_kind = |node: &Node| node.kind == kind && (kind == Kind::Virtual || node.captures);
    let choice = |node: Node| {
        let name = node.path.display().to_string();
        let label = if node.card.is_empty() { name.clone() } else { format!("{} ({name})", node.card) };
        Choice { name, label }
    };
    node::list_nodes().into_iter().filter(of_kind).map(choice).collect()
}

/// Returns the camera whose controls can be changed while `source` runs; `None` for a pair, whose pictures must stay
/// alike.
pub fn controllable_camera(source: &SourceName) -> Option<String> {
    match source {
        #[cfg(feature = "camera")]
        SourceName::Camera(camera) => Some(camera.node().display().to_string()),
        _ => None,
    }
}

/// Returns the controls of a camera; empty if it has none, or on an error (which is logged).
pub fn list_controls(camera: &str) -> Vec<CameraControl> {
    #[cfg(feature = "camera")]
    return user_controls::list_user_controls(camera).unwrap_or_else(|error| {
        tracing::info!("{error}");
        Vec::new()
    });
    #[cfg(not(feature = "camera"))]
    return {
        let _ = camera;
        Vec::new()
    };
}

/// Sets a control of a camera; returns all its controls, since others may change as well.
///
/// # Errors
/// Returns one line for users if the camera refuses.
pub fn set_control(camera: &str, control: &str, value: i64) -> Result<Vec<CameraControl>, String> {
    #[cfg(feature = "camera")]
    return user_controls::set_user_control(camera, control, value).map_err(|error| error.to_string());
    #[cfg(not(feature = "camera"))]
    return Err(format!("{camera}: this build leaves cameras out (feature `camera`), so {control} cannot be {value}"));
}

/// Watches for cameras that come and go, without opening any.
#[derive(Debug)]
pub struct CameraWatch {
    /// Device nodes at the last check.
    nodes: Vec<String>,
    /// Whether the last check found a change.
    has_changed: bool,
    #[cfg(feature = "pipewire")]
    pipewire: Option<crate::pipewire::watch::SourceWatch>,
}

impl CameraWatch {
    /// Starts to watch.
    pub fn new() -> Self {
        Self {
            nodes: list_video_nodes(),
            has_changed: false,
            #[cfg(feature = "pipewire")]
            pipewire: crate::pipewire::watch::SourceWatch::new()
                .inspect_err(|error| tracing::debug!("cameras of PipeWire are not watched: {error}"))
                .ok(),
        }
    }

    /// Whether cameras came or went since the last check. A change is reported once more by the next check: a new device
    /// node exists before its access rights are set.
    pub fn has_changed(&mut self) -> bool {
        let nodes = list_video_nodes();
        let changed = std::mem::replace(&mut self.nodes, nodes) != self.nodes;
        #[cfg(feature = "pipewire")]
        let changed = self.pipewire.as_ref().is_some_and(|watch| watch.take_change()) || changed;
        std::mem::replace(&mut self.has_changed, changed) || changed
    }
}

impl Default for CameraWatch {
    fn default() -> Self {
        Self::new()
    }
}

/// Returns the device nodes that may be cameras, from a listing of `/dev`.
fn list_video_nodes() -> Vec<String> {
    let entries = std::fs::read_dir("/dev").into_iter().flatten().flatten();
    let mut names: Vec<String> = entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.retain(|name| name.starts_with("video"));
    names.sort_unstable();
    names
}

#[cfg(test)]
mod tests {
    use super::Choice;

    #[test]
    fn a_long_path_keeps_its_end() {
        let label = |name: &str| Choice::from_name(name).label;
        assert_eq!(label("recordings/portrait"), "recordings/portrait");
        let long = "/home/somebody/with/many/folders/recordings/portrait";
        assert_eq!(label(long), "…/many/folders/recordings/portrait");
        assert_eq!(Choice::from_name(long).name, long);
        let last = format!("/home/{}", "ü".repeat(60));
        assert_eq!(label(&last), format!("…/{}", "ü".repeat(60)));
        assert_eq!(label(&"x".repeat(50)), "x".repeat(50));
    }
}
