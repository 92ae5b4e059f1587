//! Two cameras side by side as one stereo camera: pairs of frames captured within half a period of each other.
//!
//! The left camera is the clock: each of its frames waits for its partner for half a period, and is lost without one.
//! So if one camera disappears, no frame is delivered until it is back, and every left frame is accounted for.

mod pairing;

use std::time::Duration;

use super::{Camera, CaptureError, Captured, FrameBuffers, FrameData, MAX_WAIT, SourceInfo};
use crate::stats::{DropCause, Histogram};
use bokehcam::clock::Clock;
use bokehcam::frame::ColorImage;
use pairing::{Pairing, Verdict};

/// One of the two cameras.
pub trait PairedCamera: Send {
    /// Describes the camera, like [`Camera::info`].
    fn info(&self) -> SourceInfo;

    /// Reads a frame like [`Camera::next`], waiting for at most `timeout`; sets the frame's `captured_ns`.
    fn next_within(&mut self, timeout: Duration, color: &mut ColorImage) -> Captured;

    /// Releases the device, like [`Camera::suspend`].
    fn suspend(&mut self);
}

/// Two cameras as one stereo camera.
pub struct StereoPair<E> {
    left: E,
    right: E,
    clock: Clock,
    info: SourceInfo,
    pairing: Pairing,
    /// The latest picture of the right camera.
    right_color: ColorImage,
    /// Number of pairs delivered.
    delivered: u64,
    waited_ns: u64,
    /// Frames of the right camera without a partner.
    unpaired_rights: u64,
    /// Absolute time differences within the pairs.
    skews: Histogram,
}

/// Number of pairs after which their median time difference is logged.
const FIRST_PAIRS: u64 = 30;
/// Consecutive polls of the right camera: a camera that always has frames must not delay the left one.
const MAX_POLLS: usize = 8;

impl<E: PairedCamera> StereoPair<E> {
    /// Pairs the frames of `left` and `right`; `frames` are to be delivered ([`SourceInfo::frames`]).
    ///
    /// # Errors
    /// Their pictures differ in size.
    pub fn new(left: E, right: E, clock: Clock, frames: Option<u64>) -> Result<Self, CaptureError> {
        let (left_info, right_info) = (left.info(), right.info());
        if left_info.size != right_info.size {
            let names = [left_info.name, right_info.name];
            return Err(CaptureError::SizesDiffer { names, left: left_info.size, right: right_info.size });
        }
        // Rates within 2 % count as equal, such as 29.97 and 30.
        if left_info.period_ns.abs_diff(right_info.period_ns) > left_info.period_ns / 50 {
            let fps = |period_ns: u64| 1e9 / period_ns as f64;
            let (left_fps, right_fps) = (fps(left_info.period_ns), fps(right_info.period_ns));
            tracing::warn!(
                "{} gives {left_fps:.1} frames a second and {} {right_fps:.1}: many frames will have no partner; \
                 choose a rate that both support with --fps",
                left_info.name,
                right_info.name
            );
        }
        let info = SourceInfo {
            name: format!("{} and {}", left_info.name, right_info.name),
            frames,
            frame_data: FrameData::RightCamera,
            ..left_info
        };
        Ok(Self {
            pairing: Pairing::new(info.period_ns),
            left,
            right,
            clock,
            info,
            right_color: ColorImage::default(),
            delivered: 0,
            waited_ns: 0,
            unpaired_rights: 0,
            skews: Histogram::default(),
        })
    }

    /// Reads frames of the right camera until one matches the current left frame. Returns how much later it was
    /// captured, in nanoseconds; `None` if none arrives in time.
    fn find_partner(&mut self) -> Option<i64> {
        let deadline_ns = self.clock.now_ns() + self.pairing.max_skew_ns();
        let mut polls = 0;
        loop {
            match self.pairing.match_frames() {
                Verdict::Pair { skew_ns } => return Some(skew_ns),
                Verdict::UnpairedLeft | Verdict::NeedsLeft => return None,
                Verdict::UnpairedRight => self.unpaired_rights += 1,
                Verdict::NeedsRight => {}
            }
            let remaining_ns = deadline_ns.saturating_sub(self.clock.now_ns());
            // The partner may be available already, however late it is: always poll once.
            if remaining_ns == 0 && polls > 0 || polls == MAX_POLLS {
                self.pairing.drop_left();
                return None;
            }
            polls += 1;
            let began_ns = self.clock.now_ns();
            match self.right.next_within(Duration::from_nanos(remaining_ns), &mut self.right_color) {
                Captured::Frame(stamp) => self.pairing.set_right(stamp.captured_ns.unwrap_or(began_ns)),
                Captured::Lost(count, cause) => {
                    tracing::debug!("{count} frames of the right camera were lost: {cause:?}");
                }
                Captured::Waiting | Captured::Corrupt(_) | Captured::End => {}
            }
            self.waited_ns += self.clock.now_ns() - began_ns;
        }
    }

    /// Records the time difference of a pair, and logs the median once, after [`FIRST_PAIRS`].
    fn record_skew(&mut self, skew_ns: i64) {
        self.skews.add(skew_ns.unsigned_abs());
        if self.skews.samples() == FIRST_PAIRS {
            let median_ns = self.skews.percentile_ns(0.5);
            let line =
                format!("{}: the frames of the two cameras are {:.1} ms apart", self.info.name, median_ns as f64 / 1e6);
            if median_ns > self.info.period_ns / 4 {
                tracing::warn!(
                    "{line}: the depth of moving objects will be wrong; cameras with a common trigger avoid this"
                );
            } else {
                tracing::info!("{line}");
            }
        }
    }
}

impl<E: PairedCamera> Camera for StereoPair<E> {
    fn info(&self) -> SourceInfo {
        self.info.clone()
    }

    fn next(&mut self, FrameBuffers { color, right, .. }: FrameBuffers) -> Result<Captured, CaptureError> {
        let began_ns = self.clock.now_ns();
        let captured = self.left.next_within(MAX_WAIT, color);
        self.waited_ns = self.clock.now_ns() - began_ns;
        let Captured::Frame(stamp) = captured else { return Ok(captured) };
        self.pairing.set_left(stamp.captured_ns.unwrap_or(began_ns));
        Ok(match self.find_partner() {
            Some(skew_ns) => {
                right.set_luma_from(&self.right_color);
                self.record_skew(skew_ns);
                self.delivered += 1;
                Captured::Frame(stamp)
            }
            None => Captured::Lost(1, DropCause::Unpaired),
        })
    }

    fn waited_ns(&mut self) -> u64 {
        self.waited_ns
    }

    fn suspend(&mut self) {
        self.left.suspend();
        self.right.suspend();
        self.pairing.clear();
    }
}

impl<E> Drop for StereoPair<E> {
    fn drop(&mut self) {
        let ms = |ns: u64| ns as f64 / 1e6;
        tracing::info!(
            "{}: {} pairs, {:.1} ms apart (at most {:.1}); {} frames of the right camera had no partner",
            self.info.name,
            self.delivered,
            ms(self.skews.percentile_ns(0.5)),
            ms(self.skews.max_ns()),
            self.unpaired_rights
        );
    }
}

#[cfg(test)]
mod tests;
