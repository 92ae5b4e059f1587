//! The identity of a camera, by which it is found again when its node's number has changed.

use std::fs;
use std::path::{Path, PathBuf};

use v4l::v4l_sys as sys;

use crate::v4l2::device::{Device, node_caps, zeroed};
use crate::v4l2::node::{Node, decode_text, list_nodes, short_name};

/// A camera, independent of its number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CameraIdentity {
    /// The path as it was given, possibly a link.
    requested: PathBuf,
    /// Its node when it was last found.
    node: PathBuf,
    /// Links by serial number or port that led to it.
    links: Vec<PathBuf>,
    card: String,
    bus: String,
}

impl CameraIdentity {
    /// Creates the identity of the camera behind `requested`, which answered with this capability.
    pub fn new(requested: &Path, capability: &sys::v4l2_capability) -> Self {
        let node = fs::canonicalize(requested).unwrap_or_else(|_| requested.to_owned());
        Self {
            requested: requested.to_owned(),
            links: list_links_to(&node),
            node,
            card: decode_text(&capability.card),
            bus: decode_text(&capability.bus_info),
        }
    }

    /// Its node when it was last found.
    pub fn node(&self) -> &Path {
        &self.node
    }

    /// Its node and name.
    pub fn describe(&self) -> String {
        format!("{} ({})", self.node.display(), short_name(&self.card))
    }

    /// Searches for the camera: first via its links and last node; with `search_all`, also among all nodes, each of
    /// which has to be opened.
    pub fn find_node(&mut self, search_all: bool) -> Option<PathBuf> {
        let linked = [&self.requested].into_iter().chain(&self.links).filter_map(|link| fs::canonicalize(link).ok());
        let known: Vec<PathBuf> = linked.chain([self.node.clone()]).collect();
        let found = known.into_iter().find(|node| self.is_camera_at(node));
        let found = found.or_else(|| search_all.then(|| self.find_among(&list_nodes())).flatten())?;
        self.node.clone_from(&found);
        Some(found)
    }

    /// Whether a camera with this name is at that node now, whatever its port.
    fn is_camera_at(&self, node: &Path) -> bool {
        let mut capability: sys::v4l2_capability = zeroed();
        let answered = Device::open(node).and_then(|device| device.query_capability(&mut capability));
        answered.is_ok() && self.matches_camera(&capability)
    }

    /// Whether a node with these capabilities is the camera's: its other nodes have the same name, but deliver no
    /// frames.
    fn matches_camera(&self, capability: &sys::v4l2_capability) -> bool {
        let frames = sys::V4L2_CAP_VIDEO_CAPTURE | sys::V4L2_CAP_VIDEO_CAPTURE_MPLANE;
        decode_text(&capability.card) == self.card && node_caps(capability) & frames != 0
    }

    /// Finds the node of the same camera at the same port, or else the only one of the same name.
    fn find_among(&self, nodes: &[Node]) -> Option<PathBuf> {
        let named: Vec<&Node> = nodes.iter().filter(|node| node.captures && node.card == self.card).collect();
        let same_place = named.iter().find(|node| node.bus == self.bus);
        match (same_place, named.as_slice()) {
            (Some(same), _) => Some(same.path.clone()),
            (None, [only]) => Some(only.path.clone()),
            _ => None,
        }
    }
}

/// Lists the links under `/dev/v4l` that lead to a node.
fn list_links_to(node: &Path) -> Vec<PathBuf> {
    let folders = ["/dev/v4l/by-id", "/dev/v4l/by-path"].into_iter().filter_map(|folder| fs::read_dir(folder).ok());
    let links = folders.flatten().flatten().map(|entry| entry.path());
    links.filter(|link| fs::canonicalize(link).is_ok_and(|target| target == node)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v4l2::node::Kind;

    fn node(path: &str, card: &str, bus: &str) -> Node {
        Node {
            path: path.into(),
            index: None,
            card: card.into(),
            driver: "uvcvideo".into(),
            bus: bus.into(),
            kind: Kind::Capture,
            captures: true,
            outputs: false,
            denied: false,
            links: Vec::new(),
            usb: None,
            problem: None,
        }
    }

    fn c920() -> CameraIdentity {
        CameraIdentity {
            requested: "/dev/video0".into(),
            node: "/dev/video0".into(),
            links: Vec::new(),
            card: "C920".into(),
            bus: "usb-1".into(),
        }
    }

    #[test]
    fn only_the_node_that_gives_frames_is_the_camera() {
        let answers = |card: &[u8; 4], node_caps: u32| {
            let capabilities = sys::V4L2_CAP_DEVICE_CAPS | sys::V4L2_CAP_VIDEO_CAPTURE | sys::V4L2_CAP_META_CAPTURE;
            let mut capability = sys::v4l2_capability { capabilities, device_caps: node_caps, ..zeroed() };
            capability.card[..4].copy_from_slice(card);
            c920().matches_camera(&capability)
        };
        for caps in [sys::V4L2_CAP_VIDEO_CAPTURE, sys::V4L2_CAP_VIDEO_CAPTURE_MPLANE] {
            assert!(answers(b"C920", caps) && !answers(b"C930", caps));
        }
        assert!(!answers(b"C920", sys::V4L2_CAP_META_CAPTURE), "it tells about the other node's pictures");
    }

    #[test]
    fn a_camera_is_known_by_its_name_and_place_and_not_by_its_number() {
        let identity = c920();
        let found = |nodes: &[Node]| identity.find_among(nodes);
        let moved = node("/dev/video4", "C920", "usb-1");
        let other = node("/dev/video0", "Laptop", "usb-1");
        let elsewhere = node("/dev/video2", "C920", "usb-3");
        let twin = node("/dev/video6", "C920", "usb-4");
        assert_eq!(found(&[other.clone(), elsewhere.clone(), moved.clone()]), Some("/dev/video4".into()));
        assert_eq!(found(&[other.clone(), elsewhere.clone()]), Some("/dev/video2".into()), "another port");
        assert_eq!(found(&[other, elsewhere, twin]), None, "two, and neither is it for sure");
        let metadata = Node { captures: false, ..moved };
        assert_eq!(found(&[metadata]), None);
    }
}
