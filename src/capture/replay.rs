//! A recording as a camera.

use std::ops::Range;
use std::sync::Arc;

use super::{Brings, Camera, CaptureError, Captured, Shot, SourceInfo};
use crate::frame::Stamp;
use crate::recording::{Recording, Scratch};

/// Which part of a recording to play.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Part {
    /// Seconds after the first frame from which frames are played.
    pub start_s: f64,
    /// Seconds after the first frame before which playing ends; `None` plays to the end.
    pub end_s: Option<f64>,
    /// Start over at the end.
    pub looped: bool,
    /// End after so many frames, those that cannot be read and those passed over included.
    pub frames: Option<u64>,
}

/// Plays a recording in the order of its frames.
pub struct Replay {
    recording: Arc<Recording>,
    scratch: Scratch,
    name: String,
    /// Frames of one lap.
    lap: Range<usize>,
    /// Media time of one lap.
    lap_ns: u64,
    /// Whether the right eye's pictures are read as well.
    right_eye: bool,
    looped: bool,
    limit: Option<u64>,
    /// Frames read or passed over so far, over all laps.
    position: u64,
    /// Good frames of this lap: a loop without any would never end.
    good: u64,
}

impl Replay {
    /// Plays `part` of `recording`, which `name` stands for in the report.
    ///
    /// # Errors
    /// There is no frame in that part.
    pub fn new(recording: Arc<Recording>, name: &str, part: &Part) -> Result<Self, CaptureError> {
        let len = recording.len();
        let first_from = |s: f64| (0..len).find(|&frame| recording.time_ns(frame) as f64 >= s * 1e9).unwrap_or(len);
        let lap = first_from(part.start_s)..part.end_s.map_or(len, first_from);
        if lap.is_empty() {
            let end_ns = len.checked_sub(1).map_or(0, |last| recording.time_ns(last) + recording.period_ns());
            return Err(CaptureError::EmptyRange {
                source_name: name.to_owned(),
                start_s: part.start_s,
                end_s: part.end_s,
                length_s: end_ns as f64 / 1e9,
            });
        }
        let lap_ns = recording.time_ns(lap.end - 1) - recording.time_ns(lap.start) + recording.period_ns();
        Ok(Self {
            recording,
            scratch: Scratch::default(),
            name: name.to_owned(),
            lap,
            lap_ns,
            right_eye: false,
            looped: part.looped,
            limit: part.frames,
            position: 0,
            good: 0,
        })
    }

    /// Reads what the right eye saw as well. Frames of a recording with one eye are corrupt then.
    #[must_use]
    pub fn with_right_eye(self) -> Self {
        Self { right_eye: true, ..self }
    }

    /// Frames in all, over all laps; `None` where there is no end.
    fn total(&self) -> Option<u64> {
        let lap = (!self.looped).then_some(self.lap.len() as u64);
        lap.into_iter().chain(self.limit).min()
    }

    /// The frame at the present position, if there is one.
    fn stamp(&self) -> Option<Stamp> {
        if self.total().is_some_and(|total| self.position >= total) {
            return None;
        }
        let lap_len = self.lap.len() as u64;
        let index = self.lap.start + (self.position % lap_len) as usize;
        let in_lap_ns = self.recording.time_ns(index) - self.recording.time_ns(self.lap.start);
        // Media time beyond 64 bits ends the loop.
        let time_ns = (self.position / lap_len).checked_mul(self.lap_ns)?.checked_add(in_lap_ns)?;
        Some(Stamp { index, time_ns, captured_ns: None })
    }
}

impl Camera for Replay {
    fn info(&self) -> SourceInfo {
        SourceInfo {
            name: self.name.clone(),
            size: self.recording.size(),
            period_ns: self.recording.period_ns(),
            frames: self.total(),
            live: false,
            brings: if self.right_eye { Brings::RightEye } else { Brings::Color },
        }
    }

    fn next(&mut self, shot: Shot) -> Result<Captured, CaptureError> {
        let Some(stamp) = self.stamp() else { return Ok(Captured::End) };
        if stamp.index == self.lap.start {
            // A whole lap without a good frame.
            if self.position > 0 && self.good == 0 {
                return Ok(Captured::End);
            }
            self.good = 0;
        }
        self.position += 1;
        let Shot { color, right, .. } = shot;
        let mut read = self.recording.read_color(stamp.index, &mut self.scratch, color);
        if self.right_eye && read.is_ok() {
            read = self.recording.read_right(stamp.index, &mut self.scratch, right);
        }
        Ok(match read {
            Ok(()) => {
                self.good += 1;
                Captured::Frame(stamp)
            }
            Err(error) => Captured::Corrupt(error.into()),
        })
    }

    fn skip(&mut self, until_ns: u64) -> u64 {
        let from = self.position;
        while self.stamp().is_some_and(|stamp| stamp.time_ns < until_ns) {
            self.position += 1;
            // It counts as good: it is not known to be bad.
            self.good += 1;
        }
        self.position - from
    }
}
