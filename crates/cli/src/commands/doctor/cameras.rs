//! Checks of cameras: connection, formats, current holders, low-light frame rate.

use super::finding::Finding;
use super::system::System;
use bokehcam_live::layout::Content;
use bokehcam_live::v4l2::controls::{self, LOW_LIGHT_CONTROL, Value};
use bokehcam_live::v4l2::holders::{Holder, list_holders};
use bokehcam_live::v4l2::modes::{FormatModes, Interval, Rates, SizeModes, Sizes, list_modes};
use bokehcam_live::v4l2::node::{Kind, Node};
use bokehcam_live::v4l2::{Device, controls::Control};

pub const TOPIC: &str = "camera";

/// Data rate of USB 2 (high speed).
const USB2_MBIT_PER_S: f32 = 480.0;

/// Drivers of raw sensors, which only libcamera can turn into pictures.
const RAW_DRIVERS: [&str; 4] = ["isys", "intel-ipu6-isys", "intel-ipu7-isys", "ipu3-cio2"];

/// What is known of libcamera 0.7 on such machines: its software processing ends with an assertion at some widths that are
/// not the sensor's own, and takes the session manager along.
const RAW_ADVICE: &str = "read it through PipeWire: `bokehcam devices` lists it once libcamera's part for PipeWire is \
                          installed, for one program at a time; if it fails at --size 640x480, 1280x720 or 1920x1080, \
                          give one of the sizes listed there, or connect a USB camera";

/// Checks the cameras, and the nodes that could be cameras.
pub fn check_cameras(nodes: &[Node], system: &System) -> Vec<Finding> {
    let (raw, cameras): (Vec<&Node>, Vec<&Node>) = nodes
        .iter()
        .filter(|node| node.kind == Kind::Capture)
        .partition(|node| RAW_DRIVERS.contains(&node.driver.as_str()));
    let mut findings: Vec<Finding> = cameras.iter().flat_map(|node| check_camera(node)).collect();
    for node in nodes.iter().filter(|node| node.denied && node.kind == Kind::Other) {
        findings.push(report_denied(TOPIC, node));
    }
    if let Some(node) = raw.first() {
        let found = format!("{} nodes such as {node} give raw sensor data, which only libcamera can use", raw.len());
        findings.push(Finding::note(TOPIC, found, RAW_ADVICE));
    }
    if cameras.is_empty() {
        findings.push(report_none(system));
    }
    findings
}

/// Reports that there is no camera.
pub fn report_none(system: &System) -> Finding {
    let fix = match &system.sandbox {
        Some(sandbox) => format!("let this {sandbox} have the camera's node, such as /dev/video0"),
        None => "connect a camera; if it is connected, see `lsusb` and `sudo dmesg`".to_owned(),
    };
    Finding::missing(TOPIC, "there is none", fix)
}

/// Reports a node that this user may not open.
pub fn report_denied(about: &'static str, node: &Node) -> Finding {
    let fix = "run `sudo usermod -aG video \"$USER\"`, then log out and in again";
    Finding::missing(about, format!("{node}: this user may not open it"), fix)
}

/// Checks one camera: whether it opens, its best mode, its USB connection, its other holders, its rate in low light.
fn check_camera(node: &Node) -> Vec<Finding> {
    // Before this program opens the node and becomes a holder.
    let holders = list_holders(&node.path);
    let device = match Device::open(&node.path) {
        Ok(device) => device,
        Err(error) => {
            return vec![Finding::missing(TOPIC, format!("{node}: {error}"), "unplug it and plug it in again")];
        }
    };
    let modes = list_modes(&device).unwrap_or_default();
    let mut findings = vec![Finding::good(TOPIC, format!("{node}: {}", describe_best_mode(&modes)))];
    if let Some(usb) = &node.usb {
        let mbit_per_s = usb.mbit_per_s;
        findings.push(if mbit_per_s < USB2_MBIT_PER_S {
            let found = format!("{node}: its USB connection carries only {mbit_per_s} Mbit/s");
            Finding::note(TOPIC, found, "use another socket or cable, and no hub")
        } else if mbit_per_s == USB2_MBIT_PER_S && !modes.iter().any(|format| format.fourcc.to_string() == "MJPG") {
            let found = format!("{node}: USB 2 without MJPG is too slow for 1280x720 at 30 fps");
            Finding::note(TOPIC, found, "use a USB 3 socket, or --size 640x480")
        } else {
            Finding::good(TOPIC, format!("{node}: USB at {mbit_per_s} Mbit/s"))
        });
    }
    findings.extend(check_holders(node, holders));
    findings.extend(check_low_light(node, &controls::list_controls(&device).unwrap_or_default()));
    findings
}

/// Reports the programs that take pictures, and those that only have the camera open, as session managers do.
fn check_holders(node: &Node, holders: Vec<Holder>) -> Vec<Finding> {
    let (taking, watching): (Vec<Holder>, Vec<Holder>) = holders.into_iter().partition(|holder| holder.has_buffers);
    let join = |holders: &[Holder]| holders.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    let taken = (!taking.is_empty()).then(|| {
        let found = format!("{node}: {} takes pictures", join(&taking));
        Finding::note(TOPIC, found, "only one program can do so: end it, or read its camera through PipeWire")
    });
    let open = (!watching.is_empty())
        .then(|| Finding::good(TOPIC, format!("{node}: {} has it open and takes no pictures", join(&watching))));
    taken.into_iter().chain(open).collect()
}

/// Notes that the camera is set to lower its frame rate in the dark for a longer exposure.
fn check_low_light(node: &Node, controls: &[Control]) -> Option<Finding> {
    let control = controls::find_control(controls, LOW_LIGHT_CONTROL)?;
    (control.value == Some(Value::Number(1)) && !control.inactive).then(|| {
        let found = format!("{node}: may give half its rate in low light ({}=1)", control.name);
        Finding::note(TOPIC, found, format!("give --control {}=0, or more light", control.name))
    })
}

/// Describes the largest mode with a smooth rate, else the fastest mode.
fn describe_best_mode(modes: &[FormatModes]) -> String {
    /// Motion looks smooth from here on; includes the 25 and 29.97 fps of some cameras.
    const SMOOTH_FPS: f64 = 24.0;
    let readable = modes.iter().filter(|format| format.fourcc.content() == Some(Content::Color));
    let all = readable.flat_map(|format| list_sizes(&format.sizes).into_iter().map(move |size| (format, size)));
    let rank = |(_, (size_px, fastest)): &(&FormatModes, ((u32, u32), Option<Interval>))| {
        let fps = fastest.map_or(0.0, Interval::fps);
        let pixels = u64::from(size_px.0) * u64::from(size_px.1);
        if fps >= SMOOTH_FPS { (1, pixels, fps as u64) } else { (0, fps as u64, pixels) }
    };
    match all.max_by_key(rank) {
        None => "has no supported format".to_owned(),
        Some((format, ((width, height), fastest))) => {
            let rate = fastest.map_or_else(String::new, |fastest| format!(" at {fastest} fps"));
            format!("up to {width}x{height}{rate} ({})", format.fourcc)
        }
    }
}

/// Returns each size with its shortest frame interval, if known; only the largest of a range.
fn list_sizes(sizes: &Sizes) -> Vec<((u32, u32), Option<Interval>)> {
    let fastest = |rates: &Rates| match rates {
        Rates::Unknown => None,
        Rates::Discrete(intervals) => intervals.first().copied(),
        Rates::Range { shortest, .. } => Some(*shortest),
    };
    match sizes {
        Sizes::Unknown => Vec::new(),
        Sizes::Discrete(sizes) => sizes.iter().map(|SizeModes { size_px, rates }| (*size_px, fastest(rates))).collect(),
        Sizes::Range { max_px, rates, .. } => vec![(*max_px, fastest(rates))],
    }
}
