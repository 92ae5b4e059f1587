//! A V4L2 camera, which recovers from being unplugged and from mode changes.

use std::time::Duration;

use super::pixels::Decoder;
use super::stereo_pair::PairedCamera;
use super::{Camera, CaptureError, Captured, FrameBuffers, FrameData, MAX_WAIT, SourceInfo};
use crate::stats::DropCause;
use crate::v4l2::live::{LiveDevice, ModeRequest, Next, Setting};
use crate::v4l2::queue::Losses;
use bokehcam::clock::Clock;
use bokehcam::frame::fit::Letterbox;
use bokehcam::frame::{ColorImage, Stamp};

/// A V4L2 camera. All its frames have one size: if the camera comes back with another one, its pictures are scaled into
/// the first size.
pub struct V4l2Camera {
    live: LiveDevice,
    clock: Clock,
    waited_ns: u64,
    decoder: Decoder,
    info: SourceInfo,
    /// Buffer for decoding pictures of another size.
    scratch: ColorImage,
    fit: Letterbox,
    times: MediaTime,
    /// Number of frames delivered.
    delivered: u64,
    /// Losses to be reported, one cause at a time.
    losses: Losses,
    /// Whether a warning about undecodable frames was logged.
    warned: bool,
}

impl V4l2Camera {
    /// Opens the camera that `name` refers to, in the mode closest to `request`, with its controls set to `settings`,
    /// and starts it. It does not end by itself; `frames` are to be delivered ([`SourceInfo::frames`]).
    ///
    /// # Errors
    /// The camera does not exist, or cannot be used.
    pub fn open(
        name: &str,
        request: ModeRequest,
        settings: Vec<Setting>,
        frames: Option<u64>,
    ) -> Result<Self, CaptureError> {
        let clock = Clock::system();
        let live = LiveDevice::open(name, request, settings, clock.clone())
            .map_err(|error| CaptureError::Camera(error.into()))?;
        // The first layout fixes the size for the whole run.
        let layout = *live.layout();
        let decoder =
            Decoder::new(&layout).map_err(|source| CaptureError::NoColor { camera: live.name().to_owned(), source })?;
        let info = SourceInfo {
            name: format!("{}, {}", live.name(), live.negotiated()),
            size: (layout.width, layout.height),
            period_ns: live.negotiated().interval.period_ns(),
            frames,
            live: true,
            frame_data: FrameData::Color,
        };
        Ok(Self {
            live,
            clock,
            waited_ns: 0,
            decoder,
            info,
            scratch: ColorImage::default(),
            fit: Letterbox::default(),
            times: MediaTime::default(),
            delivered: 0,
            losses: Losses::default(),
            warned: false,
        })
    }

    /// Reads a frame like [`Camera::next`], waiting for at most `timeout`.
    pub fn next_within(&mut self, timeout: Duration, color: &mut ColorImage) -> Captured {
        if let Some(lost) = self.next_loss() {
            return lost;
        }
        let began_ns = self.clock.now_ns();
        let next = self.live.next(timeout);
        self.waited_ns = self.clock.now_ns() - began_ns;
        let captured_ns = match next {
            Next::Frame { captured_ns } => captured_ns,
            Next::Lost(losses) => {
                self.losses = losses;
                return self.next_loss().unwrap_or(Captured::Waiting);
            }
            Next::Waiting => return Captured::Waiting,
        };
        // Released at once: a driver without free buffers drops frames.
        let is_decoded = self.decode(color);
        self.live.release_frame();
        if !is_decoded {
            return Captured::Lost(1, DropCause::Corrupt);
        }
        let index = self.delivered as usize;
        self.delivered += 1;
        Captured::Frame(Stamp {
            index,
            time_ns: self.times.since_first_ns(captured_ns),
            captured_ns: Some(captured_ns),
        })
    }

    /// Decodes the current frame into `color`. Returns false if it cannot be decoded, which is logged the first time.
    fn decode(&mut self, color: &mut ColorImage) -> bool {
        let layout = self.live.layout();
        // The camera may have come back with another layout.
        if layout != self.decoder.layout() {
            match Decoder::new(layout) {
                Ok(decoder) => self.decoder = decoder,
                Err(error) => return self.warn_undecodable(&error),
            }
        }
        let Some(planes) = self.live.planes() else { return false };
        let size = (self.decoder.layout().width, self.decoder.layout().height);
        let decoded = if size == self.info.size {
            self.decoder.decode(&planes, color)
        } else {
            self.decoder.decode(&planes, &mut self.scratch).map(|()| {
                color.resize(self.info.size.0, self.info.size.1);
                self.fit.fit(&self.scratch, color);
            })
        };
        decoded.map_or_else(|error| self.warn_undecodable(&error), |()| true)
    }

    /// Logs once why frames cannot be decoded, and returns false. Damaged frames do not end the run of a live camera.
    fn warn_undecodable(&mut self, error: &dyn std::error::Error) -> bool {
        if !self.warned {
            tracing::warn!("{}: {error}; such frames are skipped", self.live.name());
            self.warned = true;
        }
        false
    }

    /// Removes the next cause of loss to report, and returns it with its count.
    fn next_loss(&mut self) -> Option<Captured> {
        let Losses { missed, stale, corrupt } = &mut self.losses;
        let causes = [(missed, DropCause::Driver), (stale, DropCause::Evicted), (corrupt, DropCause::Corrupt)];
        let (count, cause) = causes.into_iter().find(|(count, _)| **count > 0)?;
        Some(Captured::Lost(std::mem::take(count), cause))
    }
}

impl Camera for V4l2Camera {
    fn info(&self) -> SourceInfo {
        self.info.clone()
    }

    fn next(&mut self, buffers: FrameBuffers) -> Result<Captured, CaptureError> {
        Ok(self.next_within(MAX_WAIT, buffers.color))
    }

    fn waited_ns(&mut self) -> u64 {
        self.waited_ns
    }

    fn suspend(&mut self) {
        self.live.suspend();
    }
}

impl PairedCamera for V4l2Camera {
    fn info(&self) -> SourceInfo {
        self.info.clone()
    }

    fn next_within(&mut self, timeout: Duration, color: &mut ColorImage) -> Captured {
        V4l2Camera::next_within(self, timeout, color)
    }

    fn suspend(&mut self) {
        self.live.suspend();
    }
}

/// Converts capture times to media time.
#[derive(Debug, Default)]
pub(super) struct MediaTime {
    first_ns: Option<u64>,
    last_ns: Option<u64>,
}

impl MediaTime {
    /// Returns the time since the first frame; strictly increasing, even where a driver's time stamps step back.
    pub(super) fn since_first_ns(&mut self, captured_ns: u64) -> u64 {
        let first_ns = *self.first_ns.get_or_insert(captured_ns);
        let since_ns = captured_ns.saturating_sub(first_ns);
        let time_ns = self.last_ns.map_or(since_ns, |last_ns| since_ns.max(last_ns + 1));
        self.last_ns = Some(time_ns);
        time_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn media_time_starts_at_0_and_only_goes_on() {
        let mut times = MediaTime::default();
        let times_ns = [500, 533, 520, 520, 566].map(|captured_ns| times.since_first_ns(captured_ns));
        assert_eq!(times_ns, [0, 33, 34, 35, 66]);
    }
}
