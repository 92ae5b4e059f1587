//! What the frames of a recording that is written must have in common, and what is counted about them.

use std::path::{Path, PathBuf};

use super::error::RecordingError;
use super::time::Seconds;
use super::{MAX_SIDE_PX, depth_covers};
use bokehcam::frame::{ColorImage, DepthMap};

/// The result of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordingSummary {
    /// The folder or file of the recording.
    pub dir: PathBuf,
    /// The number of frames.
    pub frames: usize,
    /// Number of files removed of an earlier recording.
    pub replaced: u64,
    /// Number of known depth values in all frames.
    pub known_depths: u64,
    /// Number of depth values beyond the range of the file, written as unknown.
    pub out_of_range_depths: u64,
}

/// The frames so far.
#[derive(Debug, Default)]
pub(super) struct FrameSequence {
    count: usize,
    last_ns: Option<u64>,
    size: Option<(u32, u32)>,
    /// Number of known depth values, and of those beyond the range of the file.
    depth_counts: (u64, u64),
}

impl FrameSequence {
    pub fn count(&self) -> usize {
        self.count
    }

    /// Checks that a frame can be the next one.
    pub fn check(&self, time_ns: u64, color: &ColorImage, depth: Option<&DepthMap>) -> Result<(), RecordingError> {
        let fault = self.find_fault(time_ns, color, depth);
        fault.map_or(Ok(()), |reason| Err(RecordingError::unrecordable(self.count)(reason)))
    }

    fn find_fault(&self, time_ns: u64, color: &ColorImage, depth: Option<&DepthMap>) -> Option<String> {
        let (width, height) = color.size();
        if let Some(last_ns) = self.last_ns.filter(|&last_ns| time_ns <= last_ns) {
            return Some(format!("its time {} s is not after the last one, {} s", Seconds(time_ns), Seconds(last_ns)));
        }
        if !(1..=MAX_SIDE_PX).contains(&width) || !(1..=MAX_SIDE_PX).contains(&height) {
            return Some(format!("it is {width}x{height}, and pictures have 1 to {MAX_SIDE_PX} pixels a side"));
        }
        if let Some((first_width, first_height)) = self.size.filter(|&size| size != color.size()) {
            return Some(format!("it is {width}x{height}, and the first frame was {first_width}x{first_height}"));
        }
        if color.rgb.len() != width as usize * height as usize * 3 {
            return Some(format!("it is {width}x{height}, and has {} bytes", color.rgb.len()));
        }
        let depth = depth?;
        let (depth_width, depth_height) = depth.size();
        if !depth_covers(depth.size(), color.size()) {
            return Some(format!("its depth is {depth_width}x{depth_height}, which does not cover {width}x{height}"));
        }
        let values = depth.metres.len();
        (values != depth_width as usize * depth_height as usize)
            .then(|| format!("its depth is {depth_width}x{depth_height}, and has {values} values"))
    }

    /// Counts a frame that was written; depth beyond `max_depth_m` was written as unknown.
    pub fn add(&mut self, time_ns: u64, color: &ColorImage, depth: Option<&DepthMap>, max_depth_m: f32) {
        (self.count, self.last_ns, self.size) = (self.count + 1, Some(time_ns), Some(color.size()));
        let metres = depth.map_or(&[][..], |depth| &depth.metres);
        let known = || metres.iter().filter(|&&metres| DepthMap::is_known(metres));
        self.depth_counts.0 += known().count() as u64;
        self.depth_counts.1 += known().filter(|&&metres| metres > max_depth_m).count() as u64;
    }

    /// Returns the result for a recording at `dir` that replaces no files.
    pub fn summary(&self, dir: &Path) -> RecordingSummary {
        let (known_depths, out_of_range_depths) = self.depth_counts;
        RecordingSummary { dir: dir.to_owned(), frames: self.count, replaced: 0, known_depths, out_of_range_depths }
    }
}
