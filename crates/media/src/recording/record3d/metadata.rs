//! The file `metadata` of a recording: sizes and times.

use std::io::{Read, Seek};

use serde::Deserialize;
use zip::ZipArchive;

use crate::recording::MAX_SIDE_PX;
use crate::recording::timeline::MAX_LENGTH_NS;
use bokehcam_files::input::MAX_TEXT_BYTES;

const NAME: &str = "metadata";

/// Frames per second if none are stated.
const DEFAULT_FPS: f64 = 30.0;

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Metadata {
    fps: Option<f64>,
    /// Width and height of depth maps.
    dw: Option<f64>,
    dh: Option<f64>,
    /// Times in seconds, by the number of the frame.
    #[serde(rename = "frameTimestamps")]
    times_s: Vec<f64>,
}

impl Metadata {
    /// Reads the metadata.
    ///
    /// # Errors
    /// It is missing or invalid; the reason in one line.
    pub fn read(archive: &mut ZipArchive<impl Read + Seek>) -> Result<Self, String> {
        let damaged = |error: &dyn std::fmt::Display| {
            format!(
                "its file {NAME} cannot be read ({}); export it again as .r3d",
                error.to_string().replace('\n', " ")
            )
        };
        let entry = archive.by_name(NAME).map_err(|error| damaged(&error))?;
        let mut bytes = Vec::new();
        entry.take(MAX_TEXT_BYTES).read_to_end(&mut bytes).map_err(|error| damaged(&error))?;
        serde_json::from_slice(&bytes).map_err(|error| damaged(&error))
    }

    /// Returns width and height of the depth maps, if they are stated.
    pub fn depth_size(&self) -> Option<(u32, u32)> {
        let side = |side: Option<f64>| side.filter(|side| (1.0..=f64::from(MAX_SIDE_PX)).contains(side));
        Some((side(self.dw)? as u32, side(self.dh)? as u32))
    }

    /// Returns the times of the frames with these increasing numbers, in nanoseconds: those that are stated, if all are
    /// and increase, else by the rate.
    pub fn times_ns(&self, numbers: impl Iterator<Item = u32> + Clone) -> Vec<u64> {
        let max_s = MAX_LENGTH_NS as f64 / 1e9;
        let origin_s = self.times_s.first().copied().unwrap_or_default();
        let stated = numbers.clone().map(|number| Some(self.times_s.get(number as usize)? - origin_s));
        let in_range = stated.map(|time_s| time_s.filter(|time_s| (0.0..=max_s).contains(time_s)));
        let stated_ns: Option<Vec<u64>> = in_range.map(|time_s| Some((time_s? * 1e9).round() as u64)).collect();
        if let Some(stated_ns) = stated_ns.filter(|times_ns| times_ns.is_sorted_by(|one, next| one < next)) {
            return stated_ns;
        }
        let fps = self.fps.filter(|fps| (0.1..=1000.0).contains(fps)).unwrap_or(DEFAULT_FPS);
        numbers.map(|number| (f64::from(number) * 1e9 / fps).round() as u64).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_those_stated_or_by_the_rate() {
        let parse = |text: &str| serde_json::from_str::<Metadata>(text).unwrap();
        let all = || 0..3;
        let stated = parse(r#"{"fps": 60, "frameTimestamps": [100.5, 100.6, 100.8], "K": [1, 2]}"#);
        assert_eq!(stated.times_ns(all()), [0, 100_000_000, 300_000_000]);
        assert_eq!(stated.times_ns([0, 2].into_iter()), [0, 300_000_000]);
        for by_rate in [
            r#"{"fps": 50}"#,
            r#"{"fps": 50, "frameTimestamps": [1, 2]}"#,
            r#"{"fps": 50, "frameTimestamps": [1, 1, 2]}"#,
            r#"{"fps": 50, "frameTimestamps": [1, 1e300, 2]}"#,
        ] {
            assert_eq!(parse(by_rate).times_ns(all()), [0, 20_000_000, 40_000_000], "{by_rate}");
        }
        assert_eq!(parse("{}").times_ns(all())[1], 33_333_333);
        assert_eq!(parse(r#"{"fps": -1}"#).times_ns(all())[1], 33_333_333);
    }

    #[test]
    fn sizes_of_depth_are_within_bounds() {
        let size = |text: &str| serde_json::from_str::<Metadata>(text).unwrap().depth_size();
        assert_eq!(size(r#"{"dw": 192, "dh": 256}"#), Some((192, 256)));
        assert_eq!(size(r#"{"dw": 192}"#), None);
        assert_eq!(size(r#"{"dw": 1e9, "dh": -3}"#), None);
    }
}
