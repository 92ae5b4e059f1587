//! Which device nodes there are, and which of them somebody means.

use std::fmt::{self, Write as _};
use std::fs;
use std::io;
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};

use serde::Serialize;
use v4l::v4l_sys as sys;

use super::device::{Device, own_caps, zeroed};

/// A node of Video4Linux, as it was when the list was made.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Node {
    /// Such as `/dev/video0`.
    pub path: PathBuf,
    /// The number in its name, if there is one.
    pub index: Option<u32>,
    /// Name of the device, for people. Two devices may have the same.
    pub card: String,
    /// Name of the driver.
    pub driver: String,
    /// Where the device is plugged in.
    pub bus: String,
    /// What it does.
    pub kind: Kind,
    /// Whether frames can be taken from it now. A virtual camera may change its mind when it is written to.
    pub captures: bool,
    /// Links that stay the same when numbers change: by the device's serial number first, then by its place.
    pub links: Vec<PathBuf>,
    /// How it is connected, where that is USB.
    pub usb: Option<Usb>,
    /// Why less is known of it than of others: it cannot be opened, or does not answer.
    pub problem: Option<String>,
}

/// What a node does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A camera, or what looks like one.
    Capture,
    /// A virtual camera of v4l2loopback: whoever writes to it gives others their frames.
    Virtual,
    /// Takes frames and shows them.
    Output,
    /// Gives data about frames, not frames.
    Metadata,
    /// A codec or scaler: frames in, frames out.
    MemoryToMemory,
    /// Anything else, or unknown.
    Other,
}

/// A USB connection.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Usb {
    /// Signalling rate, in Mbit/s: 480 is USB 2, 5000 and more USB 3.
    pub mbit_per_s: f32,
    /// Vendor and product, such as `046d:085c`.
    pub id: String,
}

/// Why a name leads to no node.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum NodeError {
    /// Nothing has this name.
    #[error("there is no camera '{name}'{}", listed(.there, ": there is ", "; no camera is connected (`bokehcam doctor` tells more)"))]
    None {
        /// The name.
        name: String,
        /// What there is.
        there: Vec<String>,
    },
    /// Several devices have this name.
    #[error("'{name}' is the name of {}; use the path of one", listed(.candidates, "", "several"))]
    Ambiguous {
        /// The name.
        name: String,
        /// All of them.
        candidates: Vec<String>,
    },
    /// The path leads to something else.
    #[error("{}: this is no device node", .0.display())]
    NotADevice(PathBuf),
}

fn listed(items: &[String], before: &str, none: &str) -> String {
    if items.is_empty() { none.to_owned() } else { before.to_owned() + &items.join(", ") }
}

impl fmt::Display for Node {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.path.display(), if self.card.is_empty() { "no name" } else { &self.card })
    }
}

/// All nodes, by number. What cannot be opened is listed too, with its [problem](Node::problem).
pub fn nodes() -> Vec<Node> {
    Places::default().nodes()
}

/// The node that is meant by `name`: its path, its number, one of its links' names, or a part of its card's name (case
/// aside). Names of cards are for nodes that frames can be taken from: real cameras before virtual ones.
///
/// # Errors
/// There is none, or there are several.
pub fn resolve(name: &str) -> Result<PathBuf, NodeError> {
    Places::default().resolve(name)
}

/// Where the system keeps its nodes.
struct Places {
    class: PathBuf,
    dev: PathBuf,
}

impl Default for Places {
    fn default() -> Self {
        Self { class: "/sys/class/video4linux".into(), dev: "/dev".into() }
    }
}

impl Places {
    fn nodes(&self) -> Vec<Node> {
        let mut names: Vec<(u32, String)> = [&self.class, &self.dev]
            .into_iter()
            .flat_map(|folder| names_in(folder))
            .filter_map(|name| Some((number(&name)?, name)))
            .collect();
        names.sort();
        names.dedup();
        let links: Vec<(PathBuf, PathBuf)> = ["by-id", "by-path"]
            .iter()
            .map(|kind| self.dev.join("v4l").join(kind))
            .flat_map(|folder| names_in(&folder).into_iter().map(move |name| folder.join(name)))
            .filter_map(|link| Some((fs::canonicalize(&link).ok()?, link)))
            .collect();
        names.iter().filter_map(|(index, name)| self.node(*index, name, &links)).collect()
    }

    /// Nothing when the device went away meanwhile.
    fn node(&self, index: u32, name: &str, links: &[(PathBuf, PathBuf)]) -> Option<Node> {
        let (path, class) = (self.dev.join(name), self.class.join(name));
        let read = |file: &str| fs::read_to_string(class.join(file)).unwrap_or_default().trim().to_owned();
        let mut node = Node {
            index: Some(index),
            card: read("name"),
            driver: String::new(),
            bus: String::new(),
            kind: Kind::Other,
            captures: false,
            links: links.iter().filter(|(target, _)| *target == path).map(|(_, link)| link.clone()).collect(),
            usb: usb(&class),
            problem: None,
            path,
        };
        let mut capability: sys::v4l2_capability = zeroed();
        match Device::open(&node.path).and_then(|device| device.query_capability(&mut capability)) {
            Ok(()) => node.describe(&capability),
            Err(error) if is_gone(&error) => return None,
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                node.problem =
                    Some(format!("the system has it, but {} is missing (a container?)", node.path.display()));
            }
            Err(error) => node.problem = Some(error.to_string()),
        }
        Some(node)
    }

    fn resolve(&self, name: &str) -> Result<PathBuf, NodeError> {
        if name.contains('/') {
            let path = PathBuf::from(name);
            return match fs::metadata(&path) {
                Ok(metadata) if metadata.file_type().is_char_device() => Ok(path),
                Ok(_) => Err(NodeError::NotADevice(path)),
                // Whoever opens it learns why it cannot be looked at.
                Err(error) if error.kind() != io::ErrorKind::NotFound => Ok(path),
                Err(_) => Err(none(name, &self.nodes())),
            };
        }
        let number = name.parse::<u32>().ok().map(|number| self.dev.join(format!("video{number}")));
        let linked = ["by-id", "by-path"].iter().map(|kind| self.dev.join("v4l").join(kind).join(name));
        let exact = number.into_iter().chain(linked).chain([self.dev.join(name)]);
        match exact.filter(|path| !name.is_empty() && path.exists()).find(|path| !path.is_dir()) {
            Some(path) => Ok(path),
            None => by_card(name, &self.nodes()).map(|node| node.path.clone()),
        }
    }
}

impl Node {
    fn describe(&mut self, capability: &sys::v4l2_capability) {
        self.card = text(&capability.card);
        self.driver = text(&capability.driver);
        self.bus = text(&capability.bus_info);
        let caps = own_caps(capability);
        let can = |any: u32| caps & any != 0;
        let frames = can(sys::V4L2_CAP_VIDEO_CAPTURE | sys::V4L2_CAP_VIDEO_CAPTURE_MPLANE);
        self.captures = frames && can(sys::V4L2_CAP_STREAMING);
        self.kind = if self.driver == LOOPBACK_DRIVER {
            Kind::Virtual
        } else if can(sys::V4L2_CAP_VIDEO_M2M | sys::V4L2_CAP_VIDEO_M2M_MPLANE) {
            self.captures = false;
            Kind::MemoryToMemory
        } else if self.captures {
            Kind::Capture
        } else if can(sys::V4L2_CAP_VIDEO_OUTPUT | sys::V4L2_CAP_VIDEO_OUTPUT_MPLANE) {
            Kind::Output
        } else if can(sys::V4L2_CAP_META_CAPTURE | sys::V4L2_CAP_META_OUTPUT) {
            Kind::Metadata
        } else {
            Kind::Other
        };
    }
}

/// What v4l2loopback calls itself, in all versions.
pub const LOOPBACK_DRIVER: &str = "v4l2 loopback";

/// The text in a field of the kernel's: up to the first zero. Bytes that are no UTF-8 become replacement characters.
pub fn text(field: &[u8]) -> String {
    let end = field.iter().position(|byte| *byte == 0).unwrap_or(field.len());
    String::from_utf8_lossy(&field[..end]).trim().to_owned()
}

fn by_card<'a>(name: &str, nodes: &'a [Node]) -> Result<&'a Node, NodeError> {
    let wanted = name.to_lowercase();
    let named = |kind| -> Vec<&Node> {
        let fits = |node: &&Node| node.captures && node.kind == kind && node.card.to_lowercase().contains(&wanted);
        nodes.iter().filter(fits).collect()
    };
    let candidates = [Kind::Capture, Kind::Virtual].into_iter().map(named).find(|found| !found.is_empty());
    match candidates.as_deref() {
        _ if name.is_empty() => Err(none(name, nodes)),
        None => Err(none(name, nodes)),
        Some([only]) => Ok(only),
        Some(several) => {
            let candidates = several.iter().map(|node| node.with_link()).collect();
            Err(NodeError::Ambiguous { name: name.to_owned(), candidates })
        }
    }
}

fn none(name: &str, nodes: &[Node]) -> NodeError {
    let there = nodes.iter().filter(|node| node.captures).map(ToString::to_string).collect();
    NodeError::None { name: name.to_owned(), there }
}

impl Node {
    /// For choosing among devices of the same name.
    fn with_link(&self) -> String {
        let mut line = self.to_string();
        if let Some(link) = self.links.first() {
            let _ = write!(line, " = {}", link.display());
        }
        line
    }
}

/// The device was unplugged.
fn is_gone(error: &io::Error) -> bool {
    const ENXIO: i32 = 6;
    const ENODEV: i32 = 19;
    matches!(error.raw_os_error(), Some(ENXIO | ENODEV))
}

fn names_in(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.sort();
    names
}

fn number(name: &str) -> Option<u32> {
    name.strip_prefix("video")?.parse().ok()
}

/// How the camera behind a node is connected, where that is USB.
pub fn usb_of(node: &Path) -> Option<Usb> {
    let node = fs::canonicalize(node).ok()?;
    usb(&Places::default().class.join(node.file_name()?))
}

/// The USB device that a node of the class belongs to: `device` leads to its interface, which lies in its folder.
fn usb(class: &Path) -> Option<Usb> {
    let interface = fs::canonicalize(class.join("device")).ok()?;
    let read = |file: &str| Some(fs::read_to_string(interface.parent()?.join(file)).ok()?.trim().to_owned());
    let id = format!("{}:{}", read("idVendor")?, read("idProduct")?);
    Some(Usb { mbit_per_s: read("speed")?.parse().ok()?, id })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn capability(driver: &str, card: &[u8], device_caps: u32) -> sys::v4l2_capability {
        let mut capability: sys::v4l2_capability = zeroed();
        capability.driver[..driver.len()].copy_from_slice(driver.as_bytes());
        capability.card[..card.len()].copy_from_slice(card);
        // A real driver names here what its other nodes can do.
        capability.capabilities = sys::V4L2_CAP_DEVICE_CAPS | sys::V4L2_CAP_VIDEO_CAPTURE | device_caps;
        capability.device_caps = device_caps;
        capability
    }

    fn node(index: u32, driver: &str, card: &str, device_caps: u32) -> Node {
        let mut node = Node {
            path: format!("/dev/video{index}").into(),
            index: Some(index),
            card: String::new(),
            driver: String::new(),
            bus: String::new(),
            kind: Kind::Other,
            captures: false,
            links: Vec::new(),
            usb: None,
            problem: None,
        };
        node.describe(&capability(driver, card.as_bytes(), device_caps));
        node
    }

    const CAMERA: u32 = sys::V4L2_CAP_VIDEO_CAPTURE | sys::V4L2_CAP_STREAMING;
    const OUTPUT: u32 = sys::V4L2_CAP_VIDEO_OUTPUT | sys::V4L2_CAP_STREAMING;

    #[test]
    fn a_node_is_what_its_own_capabilities_say() {
        let cases = [
            ("uvcvideo", CAMERA, Kind::Capture, true),
            ("rkisp1", sys::V4L2_CAP_VIDEO_CAPTURE_MPLANE | sys::V4L2_CAP_STREAMING, Kind::Capture, true),
            ("uvcvideo", sys::V4L2_CAP_META_CAPTURE | sys::V4L2_CAP_STREAMING, Kind::Metadata, false),
            ("old", sys::V4L2_CAP_VIDEO_CAPTURE | sys::V4L2_CAP_READWRITE, Kind::Other, false),
            ("codec", sys::V4L2_CAP_VIDEO_M2M_MPLANE | CAMERA, Kind::MemoryToMemory, false),
            ("vivid", OUTPUT, Kind::Output, false),
            (LOOPBACK_DRIVER, OUTPUT, Kind::Virtual, false),
            (LOOPBACK_DRIVER, CAMERA, Kind::Virtual, true),
        ];
        for (driver, caps, kind, captures) in cases {
            let node = node(0, driver, "card", caps);
            assert_eq!((node.kind, node.captures), (kind, captures), "{driver} {caps:#x}");
        }
    }

    #[test]
    fn names_that_are_no_text_do_not_stop_the_list() {
        let mut broken = node(0, "uvcvideo", "", CAMERA);
        broken.describe(&capability("uvcvideo", b"Cam\xff\xfe\0rest", CAMERA));
        assert_eq!(broken.card, "Cam\u{fffd}\u{fffd}");
        assert_eq!(text(b"full"), "full");
    }

    #[test]
    fn a_part_of_the_cards_name_finds_the_camera_and_only_cameras() {
        let nodes = [
            node(0, "uvcvideo", "HD Webcam: Front", CAMERA),
            node(1, "uvcvideo", "HD Webcam: Front", sys::V4L2_CAP_META_CAPTURE),
            node(2, "uvcvideo", "Brio", CAMERA),
            node(3, "uvcvideo", "Brio", CAMERA),
            node(10, LOOPBACK_DRIVER, "Webcam that is none", CAMERA),
            node(11, LOOPBACK_DRIVER, "Phone", CAMERA),
            node(12, LOOPBACK_DRIVER, "Idle", OUTPUT),
        ];
        let found = |name| by_card(name, &nodes).map(|node| node.index.unwrap());
        assert_eq!(found("front"), Ok(0));
        assert_eq!(found("webcam"), Ok(0), "a real camera goes before a virtual one");
        assert_eq!(found("pHONE"), Ok(11));
        let error = found("Brio").unwrap_err().to_string();
        assert_eq!(error, "'Brio' is the name of /dev/video2 (Brio), /dev/video3 (Brio); use the path of one");
        for name in ["idle", "laptop", ""] {
            let error = found(name).unwrap_err().to_string();
            assert!(error.contains("/dev/video0 (HD Webcam: Front)") && !error.contains("Idle"), "{error}");
        }
        let error = by_card("x", &[]).unwrap_err().to_string();
        assert!(error.contains("no camera is connected") && !error.contains('\n'), "{error}");
    }

    #[test]
    fn paths_numbers_and_links_lead_to_nodes() {
        let root = tempfile::tempdir().unwrap();
        let dev = root.path().join("dev");
        let class = root.path().join("class");
        fs::create_dir_all(dev.join("v4l/by-id")).unwrap();
        fs::create_dir_all(class.join("video7")).unwrap();
        fs::create_dir_all(class.join("video8")).unwrap();
        fs::write(class.join("video7/name"), "Cam\n").unwrap();
        fs::write(dev.join("video7"), "").unwrap();
        std::os::unix::fs::symlink("../../video7", dev.join("v4l/by-id/usb-Cam_1-video-index0")).unwrap();
        let places = Places { class, dev: fs::canonicalize(&dev).unwrap() };

        let nodes = places.nodes();
        assert_eq!(nodes.iter().map(|node| node.index.unwrap()).collect::<Vec<_>>(), [7, 8]);
        assert_eq!((nodes[0].card.as_str(), nodes[0].links.len()), ("Cam", 1), "known although it does not answer");
        assert!(nodes[0].problem.is_some());
        assert!(nodes[1].problem.as_ref().unwrap().contains("missing"));

        assert_eq!(places.resolve("7").unwrap(), places.dev.join("video7"));
        assert_eq!(places.resolve("video7").unwrap(), places.dev.join("video7"));
        assert_eq!(
            places.resolve("usb-Cam_1-video-index0").unwrap(),
            places.dev.join("v4l/by-id/usb-Cam_1-video-index0")
        );
        assert_eq!(places.resolve("/dev/null").unwrap(), PathBuf::from("/dev/null"));
        for wrong in ["9", "/dev/video4711", "v4l", "."] {
            assert!(matches!(places.resolve(wrong), Err(NodeError::None { .. })), "{wrong}");
        }
        let file = dev.join("video7");
        assert_eq!(places.resolve(file.to_str().unwrap()), Err(NodeError::NotADevice(file)));
    }
}
