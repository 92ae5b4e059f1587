//! A recording as a camera.

use std::ops::Range;
use std::sync::Arc;

use super::{Camera, CaptureError, Captured, FrameBuffers, FrameData, Seeker, SourceInfo};
use bokehcam::frame::Stamp;
use bokehcam_media::recording::{Recording, Scratch};

/// The range of a recording to play.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlayRange {
    /// Start of the range, in seconds after the first frame.
    pub start_s: f64,
    /// End of the range, exclusive, in seconds after the first frame; `None` plays to the end.
    pub end_s: Option<f64>,
    /// Whether to start over at the end.
    pub looped: bool,
    /// Number of frames until the end, unreadable and skipped ones included.
    pub frames: Option<u64>,
}

/// Plays a recording in frame order.
pub struct Replay {
    recording: Arc<Recording>,
    scratch: Scratch,
    name: String,
    /// Frames of one lap of the loop.
    lap: Range<usize>,
    /// Media time of one lap.
    lap_ns: u64,
    /// Whether the right camera's pictures are read, too.
    right_camera: bool,
    looped: bool,
    limit: Option<u64>,
    seeker: Arc<Seeker>,
    /// Position of the next frame, over all laps.
    position: u64,
    /// Number of frames read or skipped.
    delivered: u64,
    /// Offset from a position's source time to media time: nonzero after a seek.
    seek_offset_ns: i64,
    /// Readable frames in this lap: a loop without any would never end.
    readable: u64,
}

impl Replay {
    /// Plays `range` of `recording`, which the report calls `name`.
    ///
    /// # Errors
    /// The range contains no frame.
    pub fn new(recording: Arc<Recording>, name: &str, range: &PlayRange) -> Result<Self, CaptureError> {
        let len = recording.len();
        let first_from = |s: f64| (0..len).find(|&frame| recording.time_ns(frame) as f64 >= s * 1e9).unwrap_or(len);
        let lap = first_from(range.start_s)..range.end_s.map_or(len, first_from);
        if lap.is_empty() {
            let end_ns = len.checked_sub(1).map_or(0, |last| recording.time_ns(last) + recording.period_ns());
            return Err(CaptureError::EmptyRange {
                source_name: name.to_owned(),
                start_s: range.start_s,
                end_s: range.end_s,
                length_s: end_ns as f64 / 1e9,
            });
        }
        // The last frame lasts one period, so that a loop keeps its rhythm.
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
            right_camera: false,
            looped: range.looped,
            limit: range.frames,
            seeker: Arc::new(seeker),
            position: 0,
            delivered: 0,
            seek_offset_ns: 0,
            readable: 0,
        })
    }

    /// Reads the right camera's pictures, too. Frames of a monocular recording are then corrupt.
    #[must_use]
    pub fn with_right_camera(self) -> Self {
        Self { right_camera: true, ..self }
    }

    /// Total number of frames, over all laps; `None` if endless.
    fn total_frames(&self) -> Option<u64> {
        let lap = (!self.looped).then_some(self.lap.len() as u64);
        lap.into_iter().chain(self.limit).min()
    }

    /// Stamp of the frame at the current position; `None` at the end.
    fn current_stamp(&self) -> Option<Stamp> {
        let lap_len = self.lap.len() as u64;
        let is_over = self.limit.is_some_and(|limit| self.delivered >= limit);
        if is_over || !self.looped && self.position >= lap_len {
            return None;
        }
        let index = self.lap.start + (self.position % lap_len) as usize;
        // Media time beyond 64 bits ends the loop.
        let time_ns = self.source_time_ns(self.position)?.checked_add_signed(self.seek_offset_ns)?;
        Some(Stamp { index, time_ns, captured_ns: None })
    }

    /// Source time of a position, in playing order; `None` beyond 64 bits.
    fn source_time_ns(&self, position: u64) -> Option<u64> {
        let lap_len = self.lap.len() as u64;
        let in_lap_ns = self.seeker.time_ns((position % lap_len) as usize);
        (position / lap_len).checked_mul(self.lap_ns)?.checked_add(in_lap_ns)
    }

    fn advance(&mut self) {
        self.position += 1;
        self.delivered += 1;
    }
}

impl Camera for Replay {
    fn info(&self) -> SourceInfo {
        SourceInfo {
            name: self.name.clone(),
            size: self.recording.size(),
            period_ns: self.recording.period_ns(),
            frames: self.total_frames(),
            live: false,
            frame_data: if self.right_camera { FrameData::RightCamera } else { FrameData::Color },
        }
    }

    fn next(&mut self, buffers: FrameBuffers) -> Result<Captured, CaptureError> {
        let Some(stamp) = self.current_stamp() else { return Ok(Captured::End) };
        if stamp.index == self.lap.start {
            // A whole lap without a readable frame.
            if self.delivered > 0 && self.readable == 0 {
                return Ok(Captured::End);
            }
            self.readable = 0;
        }
        self.advance();
        let FrameBuffers { color, right, .. } = buffers;
        let mut read = self.recording.read_color(stamp.index, &mut self.scratch, color);
        if self.right_camera && read.is_ok() {
            read = self.recording.read_right(stamp.index, &mut self.scratch, right);
        }
        Ok(match read {
            Ok(()) => {
                self.readable += 1;
                Captured::Frame(stamp)
            }
            Err(error) => Captured::Corrupt(error.into()),
        })
    }

    fn skip_until(&mut self, until_ns: u64) -> u64 {
        let from = self.delivered;
        while self.current_stamp().is_some_and(|stamp| stamp.time_ns < until_ns) {
            self.advance();
            // Counts as readable: it is not known to be bad.
            self.readable += 1;
        }
        self.delivered - from
    }

    fn seeker(&mut self) -> Option<Arc<Seeker>> {
        Some(Arc::clone(&self.seeker))
    }

    fn seek(&mut self, position: usize) -> i64 {
        let lap_len = self.lap.len() as u64;
        let next_ns = self.source_time_ns(self.position).unwrap_or(u64::MAX).saturating_add_signed(self.seek_offset_ns);
        let lap = if self.looped { self.position / lap_len } else { 0 };
        self.position = lap * lap_len + (position as u64).min(lap_len - 1);
        let source_ns = self.source_time_ns(self.position).unwrap_or(u64::MAX);
        self.seek_offset_ns = next_ns.wrapping_sub(source_ns).cast_signed();
        // Skipped frames are not known to be bad.
        self.readable += 1;
        -self.seek_offset_ns
    }
}
