//! A recording as a camera.

use std::ops::Range;
use std::sync::Arc;

use super::{Brings, Camera, CaptureError, Captured, Seeker, Shot, SourceInfo};
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
    seeker: Arc<Seeker>,
    /// The next frame, over all laps.
    position: u64,
    /// Frames read or passed over so far.
    given: u64,
    /// What to add to the time of a position for media time: other than 0 after a seek.
    behind_ns: i64,
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
        let first_ns = recording.time_ns(lap.start);
        let lap_ns = recording.time_ns(lap.end - 1) - first_ns + recording.period_ns();
        let times_ns = lap.clone().map(|frame| recording.time_ns(frame) - first_ns).collect();
        let seeker = Seeker::new(lap.start, times_ns, lap_ns);
        Ok(Self {
            recording,
            scratch: Scratch::default(),
            name: name.to_owned(),
            lap,
            lap_ns,
            right_eye: false,
            looped: part.looped,
            limit: part.frames,
            seeker: Arc::new(seeker),
            position: 0,
            given: 0,
            behind_ns: 0,
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
        let lap_len = self.lap.len() as u64;
        let is_over = self.limit.is_some_and(|limit| self.given >= limit);
        if is_over || !self.looped && self.position >= lap_len {
            return None;
        }
        let index = self.lap.start + (self.position % lap_len) as usize;
        // Media time beyond 64 bits ends the loop.
        let time_ns = self.own_ns(self.position)?.checked_add_signed(self.behind_ns)?;
        Some(Stamp { index, time_ns, captured_ns: None })
    }

    /// When a position is, where all are played in their order; `None` beyond 64 bits.
    fn own_ns(&self, position: u64) -> Option<u64> {
        let lap_len = self.lap.len() as u64;
        let in_lap_ns = self.seeker.time_ns((position % lap_len) as usize);
        (position / lap_len).checked_mul(self.lap_ns)?.checked_add(in_lap_ns)
    }

    fn advance(&mut self) {
        self.position += 1;
        self.given += 1;
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
            if self.given > 0 && self.good == 0 {
                return Ok(Captured::End);
            }
            self.good = 0;
        }
        self.advance();
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
        let from = self.given;
        while self.stamp().is_some_and(|stamp| stamp.time_ns < until_ns) {
            self.advance();
            // It counts as good: it is not known to be bad.
            self.good += 1;
        }
        self.given - from
    }

    fn seeker(&self) -> Option<Arc<Seeker>> {
        Some(Arc::clone(&self.seeker))
    }

    fn seek(&mut self, place: usize) -> i64 {
        let lap_len = self.lap.len() as u64;
        let next_ns = self.own_ns(self.position).unwrap_or(u64::MAX).saturating_add_signed(self.behind_ns);
        let lap = if self.looped { self.position / lap_len } else { 0 };
        self.position = lap * lap_len + (place as u64).min(lap_len - 1);
        let own_ns = self.own_ns(self.position).unwrap_or(u64::MAX);
        self.behind_ns = next_ns.wrapping_sub(own_ns).cast_signed();
        // What was passed over is not known to be bad.
        self.good += 1;
        -self.behind_ns
    }
}
