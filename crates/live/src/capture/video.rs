//! A video file as a camera.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::replay::PlayRange;
use super::{Camera, CaptureError, Captured, FrameBuffers, FrameData, MAX_WAIT, Seeker, SourceInfo};
use bokehcam::frame::{ColorImage, Stamp};
use bokehcam_video::{Conversion, Decoded, Decoder, Pixels, VideoError, VideoFile};

/// Largest number of frames of a video that can be sought in: two days at 30 per second, or 40 MiB of times.
const MAX_SEEK_FRAMES: u64 = 5 << 20;

/// How long before the end of a lap the decoder of the next one starts, in seconds.
const LAP_STARTUP_S: f64 = 1.0;

/// Says what was chosen about a video, or is not shown as it should be.
pub fn warn_of_remarks(file: &VideoFile) {
    file.remarks.iter().for_each(|remark| tracing::warn!("{}: {remark}", file.path.display()));
}

/// Plays a video file in frame order; a lap of a loop is a new run of the decoder.
pub struct Video {
    file: VideoFile,
    conversion: Conversion,
    range: PlayRange,
    decoder: Decoder,
    /// The decoder of the next lap, begun shortly before the end of this one: it takes a while to start.
    next_lap: Option<Decoder>,
    /// The next picture, or the part of it that has arrived.
    picture: ColorImage,
    /// Media time of `picture`, once it is whole.
    ready_ns: Option<u64>,
    /// A fault at the end of a lap that is not reported yet.
    fault: Option<VideoError>,
    has_ended: bool,
    /// Number of frames decoded in this lap, or skipped by a seek.
    in_lap: usize,
    /// Whether this lap began with a seek.
    seeks_to: bool,
    /// Time in the file of the lap's first picture; `None` before it.
    lap_start_ns: Option<i64>,
    /// Media time at which the lap began.
    lap_began_ns: u64,
    /// Media time of the last whole picture.
    last_ns: Option<u64>,
    /// Number of frames read or skipped.
    delivered: u64,
    /// `None` if frames are counted, or their number is unknown.
    seeker: Option<Arc<Seeker>>,
}

impl Video {
    /// Plays `range` of a file; all pictures get the size `size_px`, and the rate `fps` if there is one. `seeks` starts
    /// at the nearest key frame, which is faster; otherwise a frame's index counts from the first frame of the file.
    ///
    /// # Errors
    /// The range contains no frame, its first frame cannot be decoded, or ffmpeg is missing.
    pub fn open(
        file: VideoFile,
        size_px: (u32, u32),
        fps: Option<f64>,
        range: PlayRange,
        seeks: bool,
    ) -> Result<Self, CaptureError> {
        let start_s = if seeks { range.start_s } else { 0.0 };
        let conversion = Conversion { size_px, pixels: Pixels::Rgb24, fps, start_s };
        let decoder = Decoder::start(&file, &conversion)?;
        let period_ns = fps.map_or(file.period_ns, |fps| (1e9 / fps) as u64);
        let frames = VideoFile { period_ns, ..file.clone() }.count_frames(range.start_s, range.end_s);
        // The time of a frame in the middle is that of a constant rate.
        let seeker = frames.filter(|&frames| seeks && (1..=MAX_SEEK_FRAMES).contains(&frames)).map(|frames| {
            let times_ns = (0..frames).map(|frame| frame * period_ns).collect();
            Arc::new(Seeker::new(0, times_ns, frames * period_ns))
        });
        let mut video = Self {
            picture: ColorImage::new(size_px.0, size_px.1),
            file,
            conversion,
            range,
            decoder,
            next_lap: None,
            ready_ns: None,
            fault: None,
            has_ended: false,
            in_lap: 0,
            seeks_to: false,
            lap_start_ns: None,
            lap_began_ns: 0,
            last_ns: None,
            delivered: 0,
            seeker,
        };
        // Faults of the whole file are known before an output begins.
        while !video.prepare(MAX_WAIT)? && !video.has_ended {}
        match video.fault.take() {
            Some(fault) if video.ready_ns.is_none() => Err(fault.into()),
            _ if video.ready_ns.is_none() => Err(CaptureError::EmptyRange {
                source_name: video.file.path.display().to_string(),
                start_s: range.start_s,
                end_s: range.end_s,
                length_s: video.file.length_s.unwrap_or(0.0),
            }),
            _ => Ok(video),
        }
    }

    fn period_ns(&self) -> u64 {
        self.conversion.fps.map_or(self.file.period_ns, |fps| (1e9 / fps) as u64)
    }

    /// Decodes the next picture as far as it arrives within `patience`; returns whether it is whole.
    fn prepare(&mut self, patience: Duration) -> Result<bool, VideoError> {
        while self.ready_ns.is_none() && !self.has_ended {
            match self.decoder.read(&mut self.picture.rgb, patience) {
                Ok(Decoded::Waiting) => return Ok(false),
                Ok(Decoded::Picture(time_ns)) => {
                    let time_ns = time_ns.unwrap_or_else(|| self.estimate_time_ns());
                    self.in_lap += 1;
                    self.prepare_next_lap(time_ns)?;
                    if self.range.end_s.is_some_and(|end_s| time_ns as f64 >= end_s * 1e9) {
                        self.end_lap()?;
                    } else if self.seeks_to
                        || self.conversion.start_s > 0.0
                        || time_ns as f64 >= self.range.start_s * 1e9
                    {
                        self.ready_ns = Some(self.media_time_ns(time_ns));
                    }
                }
                Ok(Decoded::End) => {
                    // Once, not in every lap.
                    let remark = self.decoder.take_remark().filter(|_| self.lap_began_ns == 0);
                    remark.iter().for_each(|remark| tracing::warn!("{remark}"));
                    self.end_lap()?;
                }
                Err(fault @ VideoError::Damaged { .. }) => {
                    self.fault = Some(fault);
                    self.end_lap()?;
                }
                Err(error) => return Err(error),
            }
        }
        Ok(self.ready_ns.is_some())
    }

    /// Returns the time in the file of a picture without one: a period after the previous one.
    fn estimate_time_ns(&self) -> i64 {
        let before_ns = self.lap_start_ns.zip(self.last_ns);
        before_ns.map_or(0, |(start_ns, last_ns)| {
            start_ns.saturating_add_unsigned(last_ns - self.lap_began_ns + self.period_ns())
        })
    }

    /// Returns the media time of a picture: later than the last one, whatever the file states.
    fn media_time_ns(&mut self, time_ns: i64) -> u64 {
        let lap_start_ns = *self.lap_start_ns.get_or_insert(time_ns);
        let in_lap_ns = u64::try_from(time_ns.saturating_sub(lap_start_ns)).unwrap_or(0);
        let earliest_ns = self.last_ns.map_or(0, |last_ns| last_ns.saturating_add(1));
        let media_ns = self.lap_began_ns.saturating_add(in_lap_ns).max(earliest_ns);
        self.last_ns = Some(media_ns);
        media_ns
    }

    /// Begins the next lap, if there is one. A lap without a picture is the last.
    fn end_lap(&mut self) -> Result<(), VideoError> {
        if !self.range.looped || self.lap_start_ns.is_none() {
            self.has_ended = true;
            return Ok(());
        }
        self.lap_began_ns = self.last_ns.unwrap_or(0).saturating_add(self.period_ns());
        (self.in_lap, self.lap_start_ns, self.seeks_to) = (0, None, false);
        self.decoder = match self.next_lap.take() {
            Some(decoder) => decoder,
            None => Decoder::start(&self.file, &self.conversion)?,
        };
        Ok(())
    }

    /// Continues with the frame at a position at the media time `next_ns`; returns whether there is one.
    fn begin_at(&mut self, position: usize, next_ns: u64) -> bool {
        let period_ns = self.period_ns();
        // The decoder begins at the first frame from this time on: half a period earlier allows for rounding.
        let ahead_s = (position as u64 * period_ns).saturating_sub(period_ns / 2) as f64 / 1e9;
        let conversion = Conversion { start_s: self.range.start_s + ahead_s, ..self.conversion };
        // An error comes again with the next lap.
        let Ok(decoder) = Decoder::start(&self.file, &conversion) else { return false };
        (self.decoder, self.next_lap, self.ready_ns) = (decoder, None, None);
        (self.in_lap, self.lap_start_ns, self.lap_began_ns) = (position, None, next_ns);
        (self.seeks_to, self.has_ended) = (position > 0, false);
        // The frame that is asked for is the next one to be read.
        while !self.prepare(MAX_WAIT).unwrap_or(true) && !self.has_ended {}
        self.ready_ns.is_some()
    }

    /// Starts the decoder of the next lap if this one, which is at `time_ns` in the file, ends soon.
    fn prepare_next_lap(&mut self, time_ns: i64) -> Result<(), VideoError> {
        let end_s = [self.range.end_s, self.file.length_s].into_iter().flatten().reduce(f64::min);
        let ends_soon = end_s.is_some_and(|end_s| time_ns as f64 / 1e9 + LAP_STARTUP_S >= end_s);
        if self.range.looped && ends_soon && self.next_lap.is_none() {
            self.next_lap = Some(Decoder::start(&self.file, &self.conversion)?);
        }
        Ok(())
    }
}

impl Camera for Video {
    fn info(&self) -> SourceInfo {
        let PlayRange { start_s, end_s, looped, frames } = self.range;
        let period_ns = self.period_ns();
        let lap = VideoFile { period_ns, ..self.file.clone() }.count_frames(start_s, end_s).filter(|_| !looped);
        SourceInfo {
            name: self.file.path.display().to_string(),
            size: self.conversion.size_px,
            period_ns,
            frames: lap.into_iter().chain(frames).min(),
            live: false,
            frame_data: FrameData::Color,
        }
    }

    fn next(&mut self, buffers: FrameBuffers) -> Result<Captured, CaptureError> {
        if self.range.frames.is_some_and(|frames| self.delivered >= frames) {
            return Ok(Captured::End);
        }
        let is_ready = self.prepare(MAX_WAIT)?;
        if let Some(fault) = self.fault.take() {
            return Ok(Captured::Corrupt(fault.into()));
        }
        let Some(time_ns) = self.ready_ns.take().filter(|_| is_ready) else {
            return Ok(if self.has_ended { Captured::End } else { Captured::Waiting });
        };
        self.delivered += 1;
        std::mem::swap(buffers.color, &mut self.picture);
        self.picture.resize(self.conversion.size_px.0, self.conversion.size_px.1);
        Ok(Captured::Frame(Stamp { index: self.in_lap - 1, time_ns, captured_ns: None }))
    }

    fn skip_until(&mut self, until_ns: u64) -> u64 {
        let (from, began) = (self.delivered, Instant::now());
        // Errors come again with the next frame.
        while began.elapsed() < MAX_WAIT
            && self.range.frames.is_none_or(|frames| self.delivered < frames)
            && self.prepare(MAX_WAIT).unwrap_or(false)
            && self.ready_ns.is_some_and(|time_ns| time_ns < until_ns)
        {
            self.ready_ns = None;
            self.delivered += 1;
        }
        self.delivered - from
    }

    fn seeker(&mut self) -> Option<Arc<Seeker>> {
        self.seeker.clone()
    }

    fn seek(&mut self, position: usize) -> i64 {
        let next_ns = self.last_ns.map_or(0, |last_ns| last_ns.saturating_add(self.period_ns()));
        let position = [position, 0].into_iter().find(|&position| self.begin_at(position, next_ns)).unwrap_or(0);
        (position as u64 * self.period_ns()).wrapping_sub(next_ns).cast_signed()
    }
}
