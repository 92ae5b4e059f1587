//! Depth of a recording for colour frames of another source: paired by media time, played in a loop.

use bokehcam::depth::{DepthError, DepthSource, FrameInput};
use bokehcam::frame::DepthMap;
use bokehcam_media::recording::{Recording, Scratch};

/// Plays the depth images of a recording in a loop, paired with colour frames by media time.
pub struct LoopedRecording {
    recording: Recording,
    scratch: Scratch,
    /// Media time of one loop: from the first frame to the end of the last.
    loop_ns: u64,
    /// Offset of the colour source's own time from media time, after a seek.
    ahead_ns: i64,
    /// Index of the depth image in `map`; `None` after a failed read, which leaves `map` unspecified.
    last: Option<usize>,
    map: DepthMap,
}

impl LoopedRecording {
    /// Creates a source from the depth of `recording`; messages call it `name`.
    ///
    /// # Errors
    /// The recording has no depth.
    pub fn new(recording: Recording, name: &str) -> Result<Self, DepthError> {
        if !recording.has_depth() || recording.is_empty() {
            return Err(DepthError::NoDepth { source_name: name.to_owned() });
        }
        let loop_ns = recording.time_ns(recording.len() - 1) + recording.period_ns();
        Ok(Self { recording, scratch: Scratch::default(), loop_ns, ahead_ns: 0, last: None, map: DepthMap::default() })
    }

    /// Returns the index of the recording's frame shown at media time `time_ns`, by binary search within the loop.
    fn index_at(&self, time_ns: u64) -> usize {
        let in_loop_ns = time_ns % self.loop_ns.max(1);
        let (mut low, mut high) = (0, self.recording.len());
        while high - low > 1 {
            let middle = low.midpoint(high);
            if self.recording.time_ns(middle) <= in_loop_ns { low = middle } else { high = middle }
        }
        low
    }
}

impl DepthSource for LoopedRecording {
    fn read(&mut self, FrameInput { stamp, .. }: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
        let index = self.index_at(stamp.time_ns.saturating_add_signed(self.ahead_ns));
        // At a higher colour frame rate, one depth image serves several frames: it is decoded once.
        if self.last != Some(index) {
            self.last = None;
            self.recording.read_depth(index, &mut self.scratch, &mut self.map)?;
            self.last = Some(index);
        }
        map.resize(self.map.width, self.map.height);
        map.metres.copy_from_slice(&self.map.metres);
        Ok(())
    }

    fn seek(&mut self, ahead_ns: i64) {
        self.ahead_ns = ahead_ns;
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use bokehcam_media::recording::Options;

    #[test]
    fn each_time_has_the_frame_that_is_shown_then_lap_after_lap() {
        let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("recordings/portrait");
        let recording = Recording::open(&folder, &Options::default()).unwrap();
        let last = recording.len() - 1;
        let (last_ns, period_ns) = (recording.time_ns(last), recording.period_ns());
        let beside = LoopedRecording::new(recording, "portrait").unwrap();
        let loop_ns = last_ns + period_ns;
        let times_ns = [0, last_ns - 1, last_ns, loop_ns - 1, loop_ns, 3 * loop_ns + last_ns];
        assert!(last > 1);
        assert_eq!(times_ns.map(|time_ns| beside.index_at(time_ns)), [0, last - 1, last, last, 0, last]);
    }
}
