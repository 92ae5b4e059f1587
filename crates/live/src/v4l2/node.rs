//! The V4L2 device nodes, and the one that a user's name refers to.

use std::fmt::{self, Write as _};
use std::fs;
use std::io;
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};

use serde::Serialize;
use v4l::v4l_sys as sys;

use super::device::{Device, node_caps, zeroed};

/// A V4L2 node, as it was when it was listed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Node {
    /// For example `/dev/video0`.
    pub path: PathBuf,
    /// The number in its name, if it has one.
    pub index: Option<u32>,
    /// The device's name for users. Two devices may share one.
    pub card: String,
    /// Name of the driver.
    pub driver: String,
    /// The bus address where the device is connected.
    pub bus: String,
    pub kind: Kind,
    /// Whether frames can be captured from it now. For a virtual camera, this changes when a program writes to it.
    pub captures: bool,
    /// Whether frames can be written to it now.
    pub outputs: bool,
    /// Links that stay the same when numbers change: first by the device's serial number, then by its port.
    pub links: Vec<PathBuf>,
    /// Its USB connection, if it has one.
    pub usb: Option<Usb>,
    /// Whether this user has no permission to open it.
    pub denied: bool,
    /// Why its details are missing: it cannot be opened, or does not answer.
    pub problem: Option<String>,
}

/// The function of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A camera, or a similar capture device.
    Capture,
    /// A virtual camera of v4l2loopback, whose frames another program writes.
    Virtual,
    /// Accepts frames and displays them.
    Output,
    /// Delivers metadata about frames, no frames.
    Metadata,
    /// A codec or scaler: frames in, frames out.
    MemoryToMemory,
    /// Anything else, or unknown.
    Other,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Usb {
    /// Signalling rate, in Mbit/s: 480 for USB 2, 5000 and more for USB 3.
    pub mbit_per_s: f32,
    /// Vendor and product id, such as `046d:085c`.
    pub id: String,
}

/// Why a name does not resolve to a node.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum NodeError {
    /// No device has this name.
    #[error("there is no camera '{name}'{}", join_or(.available, ": there is ", "; no camera is connected (`bokehcam \
        doctor` says more)"))]
    NotFound { name: String, available: Vec<String> },
    /// Several devices have this name.
    #[error("'{name}' matches {}; use the path of one", join_or(.candidates, "", "several"))]
    Ambiguous { name: String, candidates: Vec<String> },
    /// The path does not lead to a device.
    #[error("{}: this is not a device node", .0.display())]
    NotADevice(PathBuf),
}

fn join_or(items: &[String], before: &str, none: &str) -> String {
    if items.is_empty() { none.to_owned() } else { before.to_owned() + &items.join(", ") }
}

impl fmt::Display for Node {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.path.display(), if self.card.is_empty() { "no name" } else { self.name() })
    }
}

/// Lists all nodes by number, also those that cannot be opened, with their [problem](Node::problem).
pub fn list_nodes() -> Vec<Node> {
    SystemPaths::default().list_nodes()
}

/// Resolves `name` to a node: its path, its number, the name of one of its links, or a substring of its card's name
/// (case-insensitive). Card names match only capture nodes, real cameras before virtual ones.
///
/// # Errors
/// No node matches, or several do.
pub fn resolve_node(name: &str) -> Result<PathBuf, NodeError> {
    SystemPaths::default().resolve_node(name)
}

/// The system folders with the nodes.
struct SystemPaths {
    /// The sysfs folder with one subfolder per node.
    class: PathBuf,
    dev: PathBuf,
}

impl Default for SystemPaths {
    fn default() -> Self {
        Self { class: "/sys/class/video4linux".into(), dev: "/dev".into() }
    }
}

impl SystemPaths {
    /// See [`list_nodes`].
    fn list_nodes(&self) -> Vec<Node> {
        // Reads both folders: a container may lack either.
        let mut names: Vec<(u32, String)> = [&self.class, &self.dev]
            .into_iter()
            .flat_map(|folder| list_names(folder))
            .filter_map(|name| Some((parse_node_number(&name)?, name)))
            .collect();
        names.sort();
        names.dedup();
        let links: Vec<(PathBuf, PathBuf)> = ["by-id", "by-path"]
            .iter()
            .map(|kind| self.dev.join("v4l").join(kind))
            .flat_map(|folder| list_names(&folder).into_iter().map(move |name| folder.join(name)))
            .filter_map(|link| Some((fs::canonicalize(&link).ok()?, link)))
            .collect();
        names.iter().filter_map(|(index, name)| self.read_node(*index, name, &links)).collect()
    }

    /// Describes the node `name`; `None` if its device has meanwhile gone. `links` are pairs of a target and its link.
    fn read_node(&self, index: u32, name: &str, links: &[(PathBuf, PathBuf)]) -> Option<Node> {
        let (path, class) = (self.dev.join(name), self.class.join(name));
        let read = |file: &str| fs::read_to_string(class.join(file)).unwrap_or_default().trim().to_owned();
        let mut node = Node {
            index: Some(index),
            card: read("name"),
            driver: String::new(),
            bus: String::new(),
            kind: Kind::Other,
            captures: false,
            outputs: false,
            links: links.iter().filter(|(target, _)| *target == path).map(|(_, link)| link.clone()).collect(),
            usb: read_usb(&class),
            denied: false,
            problem: None,
            path,
        };
        let mut capability: sys::v4l2_capability = zeroed();
        // The driver knows more than sysfs, but the node may be unreadable.
        match Device::open(&node.path).and_then(|device| device.query_capability(&mut capability)) {
            Ok(()) => node.apply_capability(&capability),
            Err(error) if is_unplugged(&error) => return None,
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                node.problem =
                    Some(format!("the system has it, but {} is missing (a container?)", node.path.display()));
            }
            Err(error) => {
                node.denied = error.kind() == io::ErrorKind::PermissionDenied;
                node.problem = Some(error.to_string());
            }
        }
        Some(node)
    }

    /// See [`resolve_node`].
    fn resolve_node(&self, name: &str) -> Result<PathBuf, NodeError> {
        if name.contains('/') {
            let path = PathBuf::from(name);
            return match fs::metadata(&path) {
                Ok(metadata) if metadata.file_type().is_char_device() => Ok(path),
                Ok(_) => Err(NodeError::NotADevice(path)),
                // Accepted: opening it will show why it cannot be examined.
                Err(error) if error.kind() != io::ErrorKind::NotFound => Ok(path),
                Err(_) => Err(not_found_error(name, &self.list_nodes())),
            };
        }
        let number = name.parse::<u32>().ok().map(|number| self.dev.join(format!("video{number}")));
        let linked = ["by-id", "by-path"].iter().map(|kind| self.dev.join("v4l").join(kind).join(name));
        let exact = number.into_iter().chain(linked).chain([self.dev.join(name)]);
        match exact.filter(|path| !name.is_empty() && path.exists()).find(|path| !path.is_dir()) {
            Some(path) => Ok(path),
            None => find_by_card(name, &self.list_nodes()).map(|node| node.path.clone()),
        }
    }
}

impl Node {
    /// Returns the card's name as one would say it ([`short_name`]).
    pub fn name(&self) -> &str {
        short_name(&self.card)
    }

    /// Fills in what the driver reports about the node.
    fn apply_capability(&mut self, capability: &sys::v4l2_capability) {
        self.card = decode_text(&capability.card);
        self.driver = decode_text(&capability.driver);
        self.bus = decode_text(&capability.bus_info);
        let caps = node_caps(capability);
        let has_caps = |any: u32| caps & any != 0;
        let has_frames = has_caps(sys::V4L2_CAP_VIDEO_CAPTURE | sys::V4L2_CAP_VIDEO_CAPTURE_MPLANE);
        self.captures = has_frames && has_caps(sys::V4L2_CAP_STREAMING);
        self.outputs = has_caps(sys::V4L2_CAP_VIDEO_OUTPUT | sys::V4L2_CAP_VIDEO_OUTPUT_MPLANE);
        self.kind = if self.driver == LOOPBACK_DRIVER {
            Kind::Virtual
        } else if has_caps(sys::V4L2_CAP_VIDEO_M2M | sys::V4L2_CAP_VIDEO_M2M_MPLANE) {
            // Its two queues are the ends of one conversion: frames come out only for those that go in.
            (self.captures, self.outputs) = (false, false);
            Kind::MemoryToMemory
        } else if self.captures {
            Kind::Capture
        } else if self.outputs {
            Kind::Output
        } else if has_caps(sys::V4L2_CAP_META_CAPTURE | sys::V4L2_CAP_META_OUTPUT) {
            Kind::Metadata
        } else {
            Kind::Other
        };
    }
}

/// The driver name that all versions of v4l2loopback report.
pub const LOOPBACK_DRIVER: &str = "v4l2 loopback";

/// Decodes a text field of a kernel structure, up to its first zero byte and trimmed. Invalid UTF-8 becomes replacement
/// characters.
pub fn decode_text(field: &[u8]) -> String {
    let end = field.iter().position(|byte| *byte == 0).unwrap_or(field.len());
    String::from_utf8_lossy(&field[..end]).trim().to_owned()
}

/// Returns a card's name without what it says twice: uvcvideo joins the names of product and function, which are mostly
/// the same, and the kernel cuts both at 31 bytes (`Integrated Camera: Integrated C`).
pub fn short_name(card: &str) -> &str {
    let is_repeated = |(product, function): &(&str, &str)| !function.is_empty() && product.starts_with(function);
    card.split_once(": ").filter(is_repeated).map_or(card, |(product, _)| product)
}

/// Finds the only capture node whose card name contains `name`, ignoring case. Virtual cameras count only if no real
/// one matches.
fn find_by_card<'a>(name: &str, nodes: &'a [Node]) -> Result<&'a Node, NodeError> {
    let wanted = name.to_lowercase();
    let named = |kind| -> Vec<&Node> {
        let fits = |node: &&Node| node.captures && node.kind == kind && node.card.to_lowercase().contains(&wanted);
        nodes.iter().filter(fits).collect()
    };
    let candidates = [Kind::Capture, Kind::Virtual].into_iter().map(named).find(|found| !found.is_empty());
    match candidates.as_deref().filter(|_| !name.is_empty()) {
        None => Err(not_found_error(name, nodes)),
        Some([only]) => Ok(only),
        Some(several) => {
            let candidates = several.iter().map(|node| node.describe_with_link()).collect();
            Err(NodeError::Ambiguous { name: name.to_owned(), candidates })
        }
    }
}

fn not_found_error(name: &str, nodes: &[Node]) -> NodeError {
    let available = nodes.iter().filter(|node| node.captures).map(ToString::to_string).collect();
    NodeError::NotFound { name: name.to_owned(), available }
}

impl Node {
    /// Formats the node with its first link, which distinguishes devices of the same name.
    fn describe_with_link(&self) -> String {
        let mut line = self.to_string();
        if let Some(link) = self.links.first() {
            let _ = write!(line, " = {}", link.display());
        }
        line
    }
}

/// Whether the device was unplugged.
fn is_unplugged(error: &io::Error) -> bool {
    const ENXIO: i32 = 6;
    const ENODEV: i32 = 19;
    matches!(error.raw_os_error(), Some(ENXIO | ENODEV))
}

fn list_names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.sort();
    names
}

fn parse_node_number(name: &str) -> Option<u32> {
    name.strip_prefix("video")?.parse().ok()
}

/// Returns the USB connection of the camera behind a node, if it has one.
pub fn usb_connection(node: &Path) -> Option<Usb> {
    let node = fs::canonicalize(node).ok()?;
    read_usb(&SystemPaths::default().class.join(node.file_name()?))
}

/// Reads the USB device of the node whose folder in sysfs is `class`: `device` there links to a USB interface, whose
/// parent folder is that of the USB device.
fn read_usb(class: &Path) -> Option<Usb> {
    let interface = fs::canonicalize(class.join("device")).ok()?;
    let read = |file: &str| Some(fs::read_to_string(interface.parent()?.join(file)).ok()?.trim().to_owned());
    let id = format!("{}:{}", read("idVendor")?, read("idProduct")?);
    Some(Usb { mbit_per_s: read("speed")?.parse().ok()?, id })
}

#[cfg(test)]
mod tests;
