//! Cameras of V4L2: their names, how they are opened, their modes and controls.

use std::path::Path;

use super::devices::Choice;
use super::modes::Mode;
use super::name::{NamedCamera, accepted_sources, is_file_name, missing_path_error};
use super::{DepthChoice, Frames, SourceError, SourceName, options, registration, suggestion};
use crate::camera_control::CameraControl;
use crate::capture::Camera;
use crate::capture::stereo_pair::StereoPair;
use crate::capture::v4l2::V4l2Camera;
use crate::depth::live::{LiveDepth, Units};
use crate::layout::Content;
use crate::v4l2::live::auto_lock::AutoLock;
use crate::v4l2::live::{ModeRequest, OpenError, user_controls};
use crate::v4l2::modes::{self, Rates, Sizes};
use crate::v4l2::node::{self, Kind, Node, NodeError};
use crate::v4l2::{Device, controls, controls::Value};
use bokehcam::clock::Clock;
use bokehcam::depth::DepthSource;
use bokehcam::depth::plate::CameraLock;

/// The sizes offered for a camera that supports a range of sizes.
const USUAL_SIZES: [(u32, u32); 7] =
    [(3840, 2160), (2560, 1440), (1920, 1080), (1280, 720), (960, 540), (640, 480), (640, 360)];
/// The rates offered for a camera that supports a range of rates.
const USUAL_FPS: [f64; 5] = [60.0, 50.0, 30.0, 25.0, 15.0];
/// The name of `V4L2_CID_CAMERA_ORIENTATION` among our controls, and the value `V4L2_CAMERA_ORIENTATION_BACK`.
const ORIENTATION: &str = "camera_orientation";
const ORIENTATION_BACK: i64 = 1;

/// Parses the name of one camera, or of two as `LEFT,RIGHT`; errors suggest similar names.
pub fn parse(text: &str) -> Result<SourceName, SourceError> {
    let named = |name: &str| {
        let node = node::resolve_node(name)?;
        Ok(NamedCamera { name: name.to_owned(), node })
    };
    let refuse = |error: NodeError| {
        if is_file_name(text) && matches!(error, NodeError::NotFound { .. }) {
            return Err(missing_path_error(text));
        }
        Err(SourceError::NotFound(match suggestion::find_similar(Path::new(text), Path::is_dir) {
            Some(near) => format!("{error}; or did you mean the folder {}? Use {}", near.display(), accepted_sources()),
            None => format!("{error}; use {}", accepted_sources()),
        }))
    };
    // Try a single camera first, as its own name may contain commas.
    let not_one_camera = match named(text) {
        Ok(camera) => return Ok(SourceName::Camera(camera)),
        Err(error) => error,
    };
    // For the same reason, try every comma as the separator.
    let halves = |(at, _): (usize, &str)| (&text[..at], &text[at + 1..]);
    let pairs = || text.match_indices(',').map(halves);
    for (left, right) in pairs() {
        if let (Ok(left), Ok(right)) = (named(left), named(right)) {
            let same = |a: &Path, b: &Path| a.canonicalize().ok() == b.canonicalize().ok();
            if same(&left.node, &right.node) {
                let what = format!("left and right are the same camera, {}", left.node.display());
                // If the names differ, the other camera may just not be plugged in.
                let may_come = left.name != right.name;
                return Err(if may_come { SourceError::NotFound(what) } else { SourceError::Usage(what) });
            }
            return Ok(SourceName::Cameras([left, right]));
        }
    }
    match pairs().next() {
        None => refuse(not_one_camera),
        // Report the half that is no camera.
        Some((left, right)) => refuse(named(left).and_then(|_| named(right)).err().unwrap_or(not_one_camera)),
    }
}

/// Opens a camera.
pub fn open(camera: &NamedCamera, frames: &Frames) -> Result<Box<dyn Camera>, SourceError> {
    Ok(Box::new(open_within(camera, frames, frames.frames)?))
}

/// Opens two cameras as a stereo pair.
pub fn open_pair([left, right]: &[NamedCamera; 2], frames: &Frames) -> Result<Box<dyn Camera>, SourceError> {
    let open = |camera| open_within(camera, frames, None);
    Ok(Box::new(StereoPair::new(open(left)?, open(right)?, Clock::system(), frames.frames)?))
}

fn open_within(camera: &NamedCamera, frames: &Frames, count: Option<u64>) -> Result<V4l2Camera, SourceError> {
    Ok(V4l2Camera::open(&camera.name, mode_request(frames), frames.control.clone(), count)?)
}

/// Returns the mode that is wanted of a camera.
pub fn mode_request(frames: &Frames) -> ModeRequest {
    ModeRequest {
        content: Content::Color,
        size_px: frames.size.map(|size| (size.width, size.height)),
        fps: frames.fps,
        fourcc: frames.format,
    }
}

/// Opens the depth camera `name` with scale and registration from the options.
pub fn open_depth_camera(
    name: &str,
    options: &options::Depth,
    clock: &Clock,
) -> Result<Box<dyn DepthSource>, SourceError> {
    let registration = registration::open(options, None)?;
    let units = Units { per_m: options.live_scale(), invalid: options.depth_invalid };
    match LiveDepth::open(name, units, registration, clock.clone()) {
        Ok(camera) => Ok(Box::new(camera)),
        // Probably a mistyped keyword or folder.
        Err(error @ OpenError::Name(_)) => Err(SourceError::NotFound(format!(
            "--depth {name}: {}{error}; or use auto, recorded, stereo, none, matte, mono, plate, a recording or a video of depth",
            DepthChoice::suggest_keyword(name)
        ))),
        Err(error) => Err(SourceError::DepthCamera(error.into())),
    }
}

/// Returns the function that locks a camera's exposure, white balance and focus while a plate is used.
pub fn create_lock(camera: String) -> Option<CameraLock> {
    Some(Box::new(move || match AutoLock::new(&camera) {
        Ok(held) => Some(Box::new(held)),
        Err(error) => {
            tracing::warn!("{error}: its exposure may change, and the plate is corrected as far as possible");
            None
        }
    }))
}

/// Returns the cameras.
pub fn list_cameras() -> Vec<Choice> {
    list_devices(Kind::Capture)
}

/// Returns the virtual cameras of V4L2.
pub fn list_virtual_cameras() -> Vec<Choice> {
    list_devices(Kind::Virtual)
}

fn list_devices(kind: Kind) -> Vec<Choice> {
    let of_kind = |node: &Node| node.kind == kind && (kind == Kind::Virtual || node.captures);
    let choice = |node: Node| {
        let name = node.path.display().to_string();
        let label = if node.card.is_empty() { name.clone() } else { format!("{} ({name})", node.name()) };
        Choice { name, label }
    };
    node::list_nodes().into_iter().filter(of_kind).map(choice).collect()
}

/// Returns the controls of a camera; empty if it has none, or on an error (which is logged).
pub fn list_controls(camera: &str) -> Vec<CameraControl> {
    user_controls::list_user_controls(camera).unwrap_or_else(|error| {
        tracing::info!("{error}");
        Vec::new()
    })
}

/// Sets a control of a camera; returns all its controls, since others may change as well.
///
/// # Errors
/// Returns one line for users if the camera refuses.
pub fn set_control(camera: &str, control: &str, value: i64) -> Result<Vec<CameraControl>, String> {
    user_controls::set_user_control(camera, control, value).map_err(|error| error.to_string())
}

/// Returns sizes and rates of a camera over all its formats, the largest first; empty if they are unknown or on an
/// error (which is logged).
pub fn list_modes(camera: &str) -> Vec<Mode> {
    let asked = node::resolve_node(camera).map_err(|error| error.to_string()).and_then(|path| {
        let device = Device::open(&path).map_err(|error| error.to_string())?;
        modes::list_modes(&device).map_err(|error| error.to_string())
    });
    asked.map(|formats| merge_formats(&formats)).unwrap_or_else(|error| {
        tracing::info!("{camera}: its sizes cannot be listed: {error}");
        Vec::new()
    })
}

/// Joins the modes of all formats: the largest size first, each with its rates, the fastest first.
fn merge_formats(formats: &[modes::FormatModes]) -> Vec<Mode> {
    let mut joined: Vec<Mode> = Vec::new();
    let mut add = |size: (u32, u32), rates: &Rates| {
        let fps: Vec<f64> = match rates {
            Rates::Unknown => Vec::new(),
            Rates::Discrete(intervals) => intervals.iter().map(|interval| interval.fps()).collect(),
            Rates::Range { shortest, longest } => {
                let range = longest.fps() - 1e-3..=shortest.fps() + 1e-3;
                USUAL_FPS.into_iter().filter(|fps| range.contains(fps)).collect()
            }
        };
        let at = joined.iter().position(|mode| mode.size == size).unwrap_or_else(|| {
            joined.push(Mode { size, fps: Vec::new() });
            joined.len() - 1
        });
        for rate in fps {
            if !joined[at].fps.iter().any(|other| (other - rate).abs() < 0.01) {
                joined[at].fps.push(rate);
            }
        }
    };
    for format in formats.iter().filter(|format| !format.emulated) {
        match &format.sizes {
            Sizes::Unknown => {}
            Sizes::Discrete(sizes) => sizes.iter().for_each(|mode| add(mode.size_px, &mode.rates)),
            Sizes::Range { min_px, max_px, step_px, rates } => {
                let fits = |side: u32, min: u32, max: u32, step: u32| {
                    (min..=max).contains(&side) && (side - min).is_multiple_of(step.max(1))
                };
                let is_there = |&(width, height): &(u32, u32)| {
                    fits(width, min_px.0, max_px.0, step_px.0) && fits(height, min_px.1, max_px.1, step_px.1)
                };
                USUAL_SIZES.into_iter().filter(is_there).for_each(|size| add(size, rates));
            }
        }
    }
    joined.sort_by_key(|mode| std::cmp::Reverse((u64::from(mode.size.0) * u64::from(mode.size.1), mode.size)));
    joined.iter_mut().for_each(|mode| mode.fps.sort_by(|a, b| b.total_cmp(a)));
    joined
}

/// Returns whether users expect this camera's pictures to be mirrored: true for all cameras except virtual ones, and
/// those that report to be on the back of a device.
pub fn faces_user(camera: &str) -> bool {
    let Ok(path) = node::resolve_node(camera) else { return false };
    let path = path.canonicalize().unwrap_or(path);
    let is_virtual = node::list_nodes().iter().any(|node| node.path == path && node.kind == node::Kind::Virtual);
    let orientation = Device::open(&path).ok().and_then(|device| controls::read_control(&device, ORIENTATION).ok());
    !is_virtual && !matches!(orientation, Some(Value::Number(ORIENTATION_BACK)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v4l2::modes::{FormatModes, Interval, QueueKind, SizeModes};

    fn format(emulated: bool, sizes: Sizes) -> FormatModes {
        let (fourcc, description) = ("YUYV".parse().unwrap(), String::new());
        FormatModes { queue: QueueKind::SinglePlanar, fourcc, description, emulated, sizes }
    }

    fn at(fps: &[f64]) -> Rates {
        Rates::Discrete(fps.iter().map(|&fps| Interval::from_fps(fps)).collect())
    }

    #[test]
    fn formats_are_joined_by_size_and_ranges_have_the_usual_sizes() {
        let sizes = |list: &[((u32, u32), &[f64])]| {
            Sizes::Discrete(list.iter().map(|&(size_px, fps)| SizeModes { size_px, rates: at(fps) }).collect())
        };
        let formats = [
            format(false, sizes(&[((640, 480), &[30.0, 15.0]), ((1280, 720), &[10.0])])),
            format(false, sizes(&[((1280, 720), &[30.0, 60.0]), ((1920, 1080), &[30.0])])),
            format(true, sizes(&[((4000, 3000), &[5.0])])),
        ];
        let found: Vec<_> = merge_formats(&formats).into_iter().map(|mode| (mode.size, mode.fps)).collect();
        let expected =
            [((1920, 1080), vec![30.0]), ((1280, 720), vec![60.0, 30.0, 10.0]), ((640, 480), vec![30.0, 15.0])];
        assert_eq!(found, expected);
        let (shortest, longest) = (Interval::from_fps(30.0), Interval::from_fps(15.0));
        let rates = Rates::Range { shortest, longest };
        let range = Sizes::Range { min_px: (320, 180), max_px: (1280, 720), step_px: (2, 2), rates };
        let found = merge_formats(&[format(false, range)]);
        assert_eq!(
            found.iter().map(|mode| mode.size).collect::<Vec<_>>(),
            [(1280, 720), (960, 540), (640, 480), (640, 360)]
        );
        assert!(found.iter().all(|mode| mode.fps == [30.0, 25.0, 15.0]));
    }
}
