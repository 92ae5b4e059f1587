//! Lists the cameras, virtual cameras and camera controls of this machine. A build without cameras has none.

pub use super::cameras::{list_cameras, list_controls, set_control};
pub use super::pipewire_cameras::list_pipewire_cameras;
use super::{SourceName, cameras, pipewire_cameras};

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

/// Returns the virtual cameras that could be written to.
pub fn list_virtual_cameras() -> Vec<Choice> {
    cameras::list_virtual_cameras().into_iter().chain(pipewire_cameras::find_output()).collect()
}

/// Returns the camera whose controls can be changed while `source` runs; `None` for a pair, whose pictures must stay
/// alike.
pub fn controllable_camera(source: &SourceName) -> Option<String> {
    match source {
        SourceName::Camera(camera) => Some(camera.node().display().to_string()),
        _ => None,
    }
}

/// Watches for cameras that come and go, without opening any.
#[derive(Debug)]
pub struct CameraWatch {
    /// Device nodes at the last check.
    nodes: Vec<String>,
    /// Whether the last check found a change.
    has_changed: bool,
    pipewire: Option<pipewire_cameras::SourceWatch>,
}

impl CameraWatch {
    /// Starts to watch.
    pub fn new() -> Self {
        Self { nodes: list_video_nodes(), has_changed: false, pipewire: pipewire_cameras::watch() }
    }

    /// Whether cameras came or went since the last check. A change is reported once more by the next check: a new device
    /// node exists before its access rights are set.
    pub fn has_changed(&mut self) -> bool {
        let nodes = list_video_nodes();
        let changed = std::mem::replace(&mut self.nodes, nodes) != self.nodes;
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
