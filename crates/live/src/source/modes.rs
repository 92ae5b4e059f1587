//! The sizes and rates of a camera, and whether it faces the user.

/// A picture size of a camera, and its frame rates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mode {
    /// Width and height.
    pub size: (u32, u32),
    /// Frames per second, in descending order.
    pub fps: Vec<f64>,
}

/// The sizes offered for a camera that supports a range of sizes.
#[cfg(feature = "camera")]
const USUAL_SIZES: [(u32, u32); 7] =
    [(3840, 2160), (2560, 1440), (1920, 1080), (1280, 720), (960, 540), (640, 480), (640, 360)];
/// The rates offered for a camera that supports a range of rates.
#[cfg(feature = "camera")]
const USUAL_FPS: [f64; 5] = [60.0, 50.0, 30.0, 25.0, 15.0];

/// Returns sizes and rates of a camera over all its formats, the largest first; empty if they are unknown or on an
/// error (which is logged).
pub fn list_modes(camera: &str) -> Vec<Mode> {
    #[cfg(feature = "camera")]
    {
        use crate::v4l2::{Device, modes, node};
        let asked = node::resolve_node(camera).map_err(|error| error.to_string()).and_then(|path| {
            let device = Device::open(&path).map_err(|error| error.to_string())?;
            modes::list_modes(&device).map_err(|error| error.to_string())
        });
        match asked {
            Ok(formats) => return merge_formats(&formats),
            Err(error) => tracing::info!("{camera}: its sizes cannot be listed: {error}"),
        }
    }
    let _ = camera;
    Vec::new()
}

#[cfg(feature = "camera")]
fn merge_formats(formats: &[crate::v4l2::modes::FormatModes]) -> Vec<Mode> {
    use crate::v4l2::modes::{Rates, Sizes};
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
#[cfg(feature = "camera")]
pub fn faces_user(camera: &str) -> bool {
    use crate::v4l2::{Device, controls, controls::Value, node};
    let Ok(path) = node::resolve_node(camera) else { return false };
    let path = path.canonicalize().unwrap_or(path);
    let is_virtual = node::list_nodes().iter().any(|node| node.path == path && node.kind == node::Kind::Virtual);
    let orientation = Device::open(&path).ok().and_then(|device| controls::read_control(&device, ORIENTATION).ok());
    !is_virtual && !matches!(orientation, Some(Value::Number(ORIENTATION_BACK)))
}

/// Returns false, as this build has no cameras.
#[cfg(not(feature = "camera"))]
pub fn faces_user(_: &str) -> bool {
    false
}

/// The name of `V4L2_CID_CAMERA_ORIENTATION` among our controls, and the value `V4L2_CAMERA_ORIENTATION_BACK`.
#[cfg(feature = "camera")]
const ORIENTATION: &str = "camera_orientation";
#[cfg(feature = "camera")]
const ORIENTATION_BACK: i64 = 1;

#[cfg(all(test, feature = "camera"))]
mod tests {
    use super::*;
    use crate::v4l2::modes::{FormatModes, Interval, QueueKind, Rates, SizeModes, Sizes};

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
