//! The list of devices, as text and as JSON.

use std::fmt::Write as _;

use serde::Serialize;

use super::pipewire_cameras::{self, PipewireCamera};
use super::{CliError, DevicesCommand};
use crate::options::Global;
use crate::terminal;
use crate::terminal::print_to_stdout;
use bokehcam_live::v4l2::controls::{self, Control, Kind as ControlKind};
use bokehcam_live::v4l2::holders::{Holder, list_holders};
use bokehcam_live::v4l2::modes::{FormatModes, list_modes};
use bokehcam_live::v4l2::node::{self, Kind, Node};
use bokehcam_live::v4l2::{Device, controls::Value};

/// A device as it is listed.
#[derive(Serialize)]
struct DeviceInfo {
    #[serde(flatten)]
    node: Node,
    holders: Vec<Holder>,
    formats: Vec<FormatModes>,
    #[serde(skip_serializing_if = "Option::is_none")]
    controls: Option<Vec<Control>>,
}

/// The listed devices, in groups.
#[derive(Default, Serialize)]
struct List {
    cameras: Vec<DeviceInfo>,
    virtual_cameras: Vec<DeviceInfo>,
    /// PipeWire's cameras; these may include V4L2 cameras listed above.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pipewire: Vec<PipewireCamera>,
    /// Other nodes, listed only if named on the command line.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    others: Vec<DeviceInfo>,
}

/// Runs the command.
///
/// # Errors
/// Fails if no device matches.
pub fn run(command: &DevicesCommand, global: &Global) -> Result<(), CliError> {
    let list = match &command.device {
        None => List {
            pipewire: pipewire_cameras::list_cameras(),
            ..List::from_nodes(node::list_nodes(), false, command.controls)
        },
        Some(name) => match name.strip_prefix("pipewire:") {
            Some(name) => List { pipewire: pipewire_cameras::find_cameras(name)?, ..List::default() },
            None => List::from_nodes(find_nodes(name)?, true, command.controls),
        },
    };
    if command.json {
        // Numbers and strings always serialise.
        return print_to_stdout((serde_json::to_string_pretty(&list).unwrap_or_default() + "\n").as_bytes());
    }
    if list.to_string().is_empty() {
        if !global.quiet {
            terminal::print_to_stderr("there is no camera and no virtual camera; `bokehcam doctor` says what to do");
        }
        return Ok(());
    }
    print_to_stdout(list.to_string().as_bytes())
}

/// Formats cameras, and nodes that may be cameras, as the command lists them; without links, whose names contain serial
/// numbers.
pub fn format_devices(nodes: &[Node]) -> String {
    let nodes = nodes.iter().map(|node| Node { links: Vec::new(), ..node.clone() });
    let list = List { pipewire: pipewire_cameras::list_cameras(), ..List::from_nodes(nodes.collect(), false, false) };
    let listed = list.to_string();
    if listed.is_empty() { "none".to_owned() } else { listed }
}

/// Finds the node that `name` resolves to (see [`node::resolve_node`]), else all nodes whose card name contains it, even
/// those that give no pictures.
fn find_nodes(name: &str) -> Result<Vec<Node>, CliError> {
    let nodes = node::list_nodes();
    let path = match node::resolve_node(name) {
        Ok(path) => path,
        Err(error) => {
            let wanted = name.to_lowercase();
            let by_card = |node: &Node| !name.is_empty() && node.card.to_lowercase().contains(&wanted);
            let found: Vec<Node> = nodes.into_iter().filter(by_card).collect();
            return if found.is_empty() { Err(CliError::Part(error.into())) } else { Ok(found) };
        }
    };
    // Nodes are listed by their real paths, and this may be a link.
    let real_path = path.canonicalize().unwrap_or_else(|_| path.clone());
    let found: Vec<Node> = nodes.into_iter().filter(|node| node.path == real_path).collect();
    if found.is_empty() { Err(CliError::NotVideo(path)) } else { Ok(found) }
}

impl List {
    /// Sorts nodes into groups; `by_name` keeps nodes that are no cameras, too.
    fn from_nodes(nodes: Vec<Node>, by_name: bool, with_controls: bool) -> Self {
        let mut list = Self::default();
        for node in nodes {
            let group = match node.kind {
                Kind::Capture => &mut list.cameras,
                Kind::Virtual => &mut list.virtual_cameras,
                // Possibly a camera: without permission its kind is unknown.
                _ if node.denied => &mut list.cameras,
                _ if by_name => &mut list.others,
                _ => continue,
            };
            group.push(DeviceInfo::read(node, with_controls));
        }
        list
    }
}

impl DeviceInfo {
    fn read(node: Node, with_controls: bool) -> Self {
        // Before this program opens the node and becomes a holder.
        let holders = list_holders(&node.path);
        let device = Device::open(&node.path).ok();
        let formats = device.as_ref().and_then(|device| list_modes(device).ok()).unwrap_or_default();
        let controls =
            with_controls.then(|| device.and_then(|device| controls::list_controls(&device).ok()).unwrap_or_default());
        Self { node, holders, formats, controls }
    }
}

impl std::fmt::Display for List {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let groups = [("cameras", &self.cameras), ("virtual cameras", &self.virtual_cameras), ("others", &self.others)];
        let mut first = true;
        for (heading, group) in groups.iter().filter(|(_, group)| !group.is_empty()) {
            writeln!(f, "{}{heading}", if first { "" } else { "\n" })?;
            first = false;
            for device in *group {
                f.write_str(&device.lines())?;
            }
        }
        if !self.pipewire.is_empty() {
            writeln!(f, "{}cameras of PipeWire", if first { "" } else { "\n" })?;
        }
        self.pipewire.iter().try_for_each(|camera| f.write_str(&camera.lines()))
    }
}

impl DeviceInfo {
    /// Formats the device as a line of names, then indented its problem, links, state, holders, formats and controls.
    fn lines(&self) -> String {
        let Self { node, holders, formats, controls } = self;
        let mut out = String::new();
        let name = if node.card.is_empty() { "no name" } else { node.name() };
        let mut attachment = vec![node.driver.clone(), node.bus.clone()];
        attachment.extend(node.usb.as_ref().map(|usb| format!("USB {}, {} Mbit/s", usb.id, usb.mbit_per_s)));
        attachment.retain(|part| !part.is_empty());
        // Writing to a string cannot fail.
        let _ = writeln!(out, "  {}  {name}  ({})", node.path.display(), attachment.join(", "));
        let mut line = |text: String| {
            let _ = writeln!(out, "    {text}");
        };
        if let Some(problem) = &node.problem {
            line(format!("cannot be opened: {problem}"));
        }
        for link in &node.links {
            line(link.display().to_string());
        }
        if node.kind == Kind::Virtual {
            line(describe_loopback_state(node).to_owned());
        }
        if !holders.is_empty() {
            let names: Vec<_> = holders.iter().map(ToString::to_string).collect();
            line(format!("opened by {}", names.join(", ")));
        }
        let (readable, others): (Vec<_>, Vec<_>) = formats.iter().partition(|format| format.fourcc.content().is_some());
        let width = readable.iter().map(|format| format.fourcc.to_string().len()).max().unwrap_or_default();
        for format in readable {
            line(format!("{:width$}  {}", format.fourcc.to_string(), format.sizes));
        }
        if !others.is_empty() {
            let names: Vec<_> = others.iter().map(|format| format.fourcc.to_string()).collect();
            line(format!("also {}, which cannot be read here", names.join(" ")));
        }
        for control in controls.iter().flatten() {
            line(format_control(control));
        }
        out
    }
}

/// Describes a virtual camera's state by its capabilities: with `exclusive_caps=1` they change with its first writer.
fn describe_loopback_state(node: &Node) -> &'static str {
    match (node.captures, node.outputs) {
        (true, true) => "can be written to and read from",
        (false, true) => "can be written to",
        (true, false) => "is being written to",
        (false, false) => "accepts neither writers nor readers: reload the module v4l2loopback",
    }
}

/// Formats a control as `name=value  (accepted values), flags`.
fn format_control(control: &Control) -> String {
    let Control { name, value, minimum, maximum, step, default, items, .. } = control;
    let mut line = name.clone();
    if let Some(value) = value {
        let _ = match (control.kind, value) {
            (ControlKind::Bitmask, Value::Number(bits)) => write!(line, "={bits:#x}"),
            _ => write!(line, "={value}"),
        };
    }
    let accepted = match control.kind {
        ControlKind::Integer | ControlKind::Integer64 if *step > 1 => {
            format!("{minimum} to {maximum} in steps of {step}, default {default}")
        }
        ControlKind::Integer | ControlKind::Integer64 => format!("{minimum} to {maximum}, default {default}"),
        ControlKind::Boolean => format!("0 or 1, default {default}"),
        ControlKind::Menu | ControlKind::IntegerMenu => {
            let items: Vec<_> = items.iter().map(|item| format!("{}: {}", item.index, item.name)).collect();
            format!("{}; default {default}", items.join(", "))
        }
        ControlKind::Button => "button".to_owned(),
        ControlKind::String => format!("text of {minimum} to {maximum} bytes"),
        ControlKind::Bitmask => format!("bits of {maximum:#x}"),
        ControlKind::Compound => "a table".to_owned(),
    };
    let _ = write!(line, "  ({accepted})");
    for (is_set, word) in
        [(control.read_only, "read-only"), (control.inactive, "inactive"), (control.grabbed, "not while streaming")]
    {
        if is_set {
            let _ = write!(line, ", {word}");
        }
    }
    line
}
