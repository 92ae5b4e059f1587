//! The modes of a capture device: formats, their sizes, and the frame rates of each size.

use std::fmt;
use std::io;

use serde::Serialize;
use v4l::v4l_sys as sys;

use super::device::{node_caps, zeroed};
use super::node::decode_text;
use super::{Device, FourCc};

/// The two kinds of capture queues. A device has one of them, or both.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum QueueKind {
    /// A frame is one block of memory.
    SinglePlanar,
    /// A frame may have several.
    MultiPlanar,
}

impl QueueKind {
    /// Both kinds, the common one first.
    pub const ALL: [Self; 2] = [Self::SinglePlanar, Self::MultiPlanar];

    /// The kernel's buffer type.
    pub fn buffer_type(self) -> u32 {
        match self {
            Self::SinglePlanar => sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE,
            Self::MultiPlanar => sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE,
        }
    }

    /// The capability flag that announces this kind.
    pub fn capability(self) -> u32 {
        match self {
            Self::SinglePlanar => sys::V4L2_CAP_VIDEO_CAPTURE,
            Self::MultiPlanar => sys::V4L2_CAP_VIDEO_CAPTURE_MPLANE,
        }
    }
}

/// A pixel format that a device offers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FormatModes {
    /// The queue that delivers it.
    pub queue: QueueKind,
    #[serde(serialize_with = "serialize_fourcc")]
    pub fourcc: FourCc,
    /// The driver's name for it.
    pub description: String,
    /// Whether a library would have to convert to it, because the device itself does not send it.
    pub emulated: bool,
    pub sizes: Sizes,
}

/// The sizes of a format.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Sizes {
    /// The driver does not list them.
    Unknown,
    /// Only these.
    Discrete(Vec<SizeModes>),
    /// All sizes on a grid.
    Range {
        /// Smallest width and height, in pixels.
        min_px: (u32, u32),
        /// Largest width and height, in pixels.
        max_px: (u32, u32),
        /// Distance between adjacent widths and heights, in pixels, > 0.
        step_px: (u32, u32),
        /// Rates at the largest size.
        rates: Rates,
    },
}

/// One size and its rates.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SizeModes {
    /// Width and height, in pixels.
    pub size_px: (u32, u32),
    /// Rates at this size.
    pub rates: Rates,
}

/// The rates of a format at a size.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Rates {
    /// The driver does not list them.
    Unknown,
    /// Only these, the fastest first.
    Discrete(Vec<Interval>),
    /// Every rate between two; in steps, if the driver has them.
    Range { shortest: Interval, longest: Interval },
}

/// Time between frames: a fraction of seconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interval {
    /// Seconds, > 0, ...
    pub numerator: u32,
    /// ... divided by this, > 0.
    pub denominator: u32,
}

impl Interval {
    /// Creates the interval, if the driver's fraction is usable.
    pub fn new(fraction: sys::v4l2_fract) -> Option<Self> {
        let sys::v4l2_fract { numerator, denominator } = fraction;
        (numerator > 0 && denominator > 0).then_some(Self { numerator, denominator })
    }

    /// Returns the interval of a rate, to a thousandth of a frame per second; NTSC rates such as 29.97 are exact
    /// (1001/30000).
    pub fn from_fps(fps: f64) -> Self {
        let nominal = (fps * 1.001).round();
        // Tolerant enough that 23.98, too, means 24000/1001 frames per second.
        if (fps - nominal / 1.001).abs() < 0.004 && (fps - fps.round()).abs() > 0.004 {
            return Self { numerator: 1001, denominator: (nominal * 1000.0) as u32 };
        }
        if (fps - fps.round()).abs() < 1e-6 {
            return Self { numerator: 1, denominator: fps.round().max(1.0) as u32 };
        }
        Self { numerator: 1000, denominator: (fps * 1000.0).round().max(1.0) as u32 }
    }

    pub fn fps(self) -> f64 {
        f64::from(self.denominator) / f64::from(self.numerator)
    }

    /// The interval in nanoseconds.
    pub fn period_ns(self) -> u64 {
        (u64::from(self.numerator) * 1_000_000_000 / u64::from(self.denominator)).max(1)
    }

    pub fn fraction(self) -> sys::v4l2_fract {
        sys::v4l2_fract { numerator: self.numerator, denominator: self.denominator }
    }
}

impl fmt::Display for Interval {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Two digits distinguish 29.97 from 30; a whole rate needs none.
        let fps = (self.fps() * 100.0).round() / 100.0;
        write!(f, "{fps}")
    }
}

impl Serialize for Interval {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Fields {
            fps: f64,
            numerator: u32,
            denominator: u32,
        }
        let Self { numerator, denominator } = *self;
        Fields { fps: (self.fps() * 1000.0).round() / 1000.0, numerator, denominator }.serialize(serializer)
    }
}

impl fmt::Display for Rates {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown => write!(f, "rates unknown"),
            Self::Discrete(intervals) => {
                for (index, interval) in intervals.iter().enumerate() {
                    write!(f, "{}{interval}", if index > 0 { ", " } else { "" })?;
                }
                write!(f, " fps")
            }
            Self::Range { shortest, longest } => write!(f, "{longest} to {shortest} fps"),
        }
    }
}

impl fmt::Display for Sizes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown => write!(f, "sizes unknown"),
            Self::Discrete(sizes) => {
                for (index, SizeModes { size_px, rates }) in sizes.iter().enumerate() {
                    write!(f, "{}{}x{} ({rates})", if index > 0 { ", " } else { "" }, size_px.0, size_px.1)?;
                }
                Ok(())
            }
            Self::Range { min_px, max_px, step_px, rates } => {
                let ((w0, h0), (w1, h1), (sw, sh)) = (min_px, max_px, step_px);
                write!(f, "{w0}x{h0} to {w1}x{h1} in steps of {sw}x{sh} ({rates})")
            }
        }
    }
}

impl Rates {
    /// Returns the offered interval nearest to `wanted`; `None` if the driver lists none.
    pub fn nearest_interval(&self, wanted: Interval) -> Option<Interval> {
        // Compared by ratio: 1/30 and 333333/10000000 are the same rate.
        let distance = |interval: &Interval| (interval.fps() / wanted.fps()).ln().abs();
        match self {
            Self::Unknown => None,
            Self::Discrete(intervals) => intervals.iter().copied().min_by(|a, b| distance(a).total_cmp(&distance(b))),
            Self::Range { shortest, .. } if wanted.fps() > shortest.fps() => Some(*shortest),
            Self::Range { longest, .. } if wanted.fps() < longest.fps() => Some(*longest),
            Self::Range { .. } => Some(wanted),
        }
    }
}

/// Limit of every list: no driver offers this many entries, so a longer list would never end.
const MAX_ENTRIES: u32 = 512;

/// Lists the formats of all capture queues of `device`, in the driver's order; empty if it captures nothing.
///
/// # Errors
/// The device does not answer (it is gone).
pub fn list_modes(device: &Device) -> io::Result<Vec<FormatModes>> {
    let mut capability = zeroed::<sys::v4l2_capability>();
    device.query_capability(&mut capability)?;
    let caps = node_caps(&capability);
    let mut found = Vec::new();
    for queue in QueueKind::ALL.into_iter().filter(|queue| caps & queue.capability() != 0) {
        for index in 0..MAX_ENTRIES {
            let mut format = zeroed::<sys::v4l2_fmtdesc>();
            (format.index, format.type_) = (index, queue.buffer_type());
            if device.enum_format(&mut format).is_err() {
                break;
            }
            found.push(FormatModes {
                queue,
                fourcc: FourCc::from_u32(format.pixelformat),
                description: decode_text(&format.description),
                emulated: format.flags & sys::V4L2_FMT_FLAG_EMULATED != 0,
                sizes: list_sizes(device, FourCc::from_u32(format.pixelformat)),
            });
        }
    }
    Ok(found)
}

/// Lists the sizes of a format, each with its rates.
fn list_sizes(device: &Device, fourcc: FourCc) -> Sizes {
    let mut discrete = Vec::new();
    for index in 0..MAX_ENTRIES {
        let mut entry = zeroed::<sys::v4l2_frmsizeenum>();
        (entry.index, entry.pixel_format) = (index, fourcc.to_u32());
        if device.enum_frame_size(&mut entry).is_err() {
            break;
        }
        match parse_size_entry(&entry) {
            Some(SizeEntry::One(size_px)) => {
                discrete.push(SizeModes { size_px, rates: list_rates(device, fourcc, size_px) })
            }
            Some(SizeEntry::Range { min_px, max_px, step_px }) => {
                return Sizes::Range { min_px, max_px, step_px, rates: list_rates(device, fourcc, max_px) };
            }
            None => {}
        }
    }
    if discrete.is_empty() { Sizes::Unknown } else { Sizes::Discrete(discrete) }
}

enum SizeEntry {
    One((u32, u32)),
    Range { min_px: (u32, u32), max_px: (u32, u32), step_px: (u32, u32) },
}

/// Returns the size or range of sizes in an entry of the driver's list; `None` if its type is unknown or its size is
/// empty.
fn parse_size_entry(entry: &sys::v4l2_frmsizeenum) -> Option<SizeEntry> {
    // SAFETY: every member of the union consists of integers, for which all bit patterns are valid.
    #[allow(unsafe_code)]
    let (one, range) = unsafe { (entry.__bindgen_anon_1.discrete, entry.__bindgen_anon_1.stepwise) };
    let found = match entry.type_ {
        sys::v4l2_frmsizetypes_V4L2_FRMSIZE_TYPE_DISCRETE => SizeEntry::One((one.width, one.height)),
        sys::v4l2_frmsizetypes_V4L2_FRMSIZE_TYPE_STEPWISE | sys::v4l2_frmsizetypes_V4L2_FRMSIZE_TYPE_CONTINUOUS => {
            SizeEntry::Range {
                min_px: (range.min_width, range.min_height),
                max_px: (range.max_width, range.max_height),
                step_px: (range.step_width.max(1), range.step_height.max(1)),
            }
        }
        _ => return None,
    };
    let largest = match found {
        SizeEntry::One(size) => size,
        SizeEntry::Range { max_px, .. } => max_px,
    };
    (largest.0 > 0 && largest.1 > 0).then_some(found)
}

/// Lists the rates of a format at a size, as the driver reports them.
fn list_rates(device: &Device, fourcc: FourCc, size_px: (u32, u32)) -> Rates {
    let mut discrete = Vec::new();
    for index in 0..MAX_ENTRIES {
        let mut entry = zeroed::<sys::v4l2_frmivalenum>();
        (entry.index, entry.pixel_format, (entry.width, entry.height)) = (index, fourcc.to_u32(), size_px);
        if device.enum_frame_interval(&mut entry).is_err() {
            break;
        }
        // SAFETY: every member of the union consists of integers, for which all bit patterns are valid.
        #[allow(unsafe_code)]
        let (one, range) = unsafe { (entry.__bindgen_anon_1.discrete, entry.__bindgen_anon_1.stepwise) };
        if entry.type_ == sys::v4l2_frmivaltypes_V4L2_FRMIVAL_TYPE_DISCRETE {
            discrete.extend(Interval::new(one));
        } else {
            let (shortest, longest) = (Interval::new(range.min), Interval::new(range.max));
            return match (shortest, longest) {
                (Some(shortest), Some(longest)) => Rates::Range { shortest, longest },
                _ => Rates::Unknown,
            };
        }
    }
    discrete.sort_by(|a, b| b.fps().total_cmp(&a.fps()));
    if discrete.is_empty() { Rates::Unknown } else { Rates::Discrete(discrete) }
}

/// Serializes the code as its text.
fn serialize_fourcc<S: serde::Serializer>(fourcc: &FourCc, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(fourcc)
}

#[cfg(test)]
mod tests;
