//! How recordings are read.

use super::depth_file::Fit;
use super::{DepthUnit, RecordingError};
use bokehcam::calibration::registration::RgbdCalibration;

/// Options for reading a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Units of the depth pictures per metre, > 0; `None` for those that the layout states or usually has.
    pub depth_scale: Option<f32>,
    /// The meaning of the values in depth pictures: distances, or relative inverse depth from 0 to the largest value.
    pub depth_unit: DepthUnit,
    /// Whether white is the farthest in relative inverse depth, instead of the nearest.
    pub depth_invert: bool,
    /// A depth value that means unknown; 0 always does.
    pub depth_invalid: Option<u16>,
    /// How depth maps of another aspect ratio than their pictures are fitted; `None` stretches those of nearly
    /// the same, and refuses others.
    pub depth_fit: Option<Fit>,
    /// The calibration of a depth camera that looks from another place than the colour camera, if the recording's depth
    /// is of its view; it replaces the recording's own.
    pub depth_calibration: Option<RgbdCalibration>,
    /// Largest time difference between a colour picture and its depth map or right picture, in nanoseconds.
    pub pair_tolerance_ns: u64,
    /// Frame period of pictures without times, in nanoseconds, > 0; `None` for that of the layout.
    pub period_ns: Option<u64>,
    /// Width and height of the scenes to read, where a recording has scenes of several sizes; `None` for the first.
    pub size: Option<(u32, u32)>,
    /// Names of the topics to read from a recording of ROS: one of colour, and one of depth. Others are chosen.
    pub topics: Vec<String>,
    /// Whether links may lead outside the recording.
    pub follow_links: bool,
    /// Whether faulty lines of lists and missing right pictures become frames that fail to read. Otherwise the first
    /// one fails [`Recording::open`](super::Recording::open).
    pub keep_going: bool,
}

impl Options {
    /// Warns that the depth of recording `name`, if it has any, is no inverse depth.
    pub(super) fn warn_of_inverse_unit(&self, name: &str, has_depth: bool) {
        if self.depth_unit == DepthUnit::Inverse && has_depth {
            tracing::warn!("without effect here: --depth-unit inverse (the depth of {name} is distances)");
        }
    }
}

impl Default for Options {
    /// Pairs within 20 ms, as in the TUM benchmark. Faulty lists and links to the outside are rejected.
    fn default() -> Self {
        Self {
            depth_scale: None,
            depth_unit: DepthUnit::Metres,
            depth_invert: false,
            depth_invalid: None,
            depth_fit: None,
            depth_calibration: None,
            pair_tolerance_ns: 20_000_000,
            period_ns: None,
            size: None,
            topics: Vec::new(),
            follow_links: false,
            keep_going: false,
        }
    }
}

pub(super) fn check_depth_scale(depth_scale: f32) -> Result<(), RecordingError> {
    if depth_scale > 0.0 && depth_scale.is_finite() { Ok(()) } else { Err(RecordingError::DepthScale(depth_scale)) }
}
