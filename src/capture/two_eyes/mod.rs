//! Two cameras beside each other as one: frames that were taken at the same time, within half a period.
//!
//! The left camera is the clock: a frame of it waits for its partner for half a period, and is lost without one. So
//! where one camera goes away nothing is shown until it is back, and every frame of the left one is accounted for.

mod pairing;

use std::time::Duration;

use super::{Brings, Camera, CaptureError, Captured, PATIENCE, Shot, SourceInfo};
use crate::clock::Clock;
use crate::frame::ColorImage;
use crate::stats::{Cause, Histogram};
use pairing::{Pairing, Verdict};

/// One of the two cameras.
pub trait Eye: Send {
    /// As [`Camera::info`].
    fn info(&self) -> SourceInfo;

    /// As [`Camera::next`], waiting no longer than `patience`; `captured_ns` of the frame is set.
    fn next_within(&mut self, patience: Duration, color: &mut ColorImage) -> Captured;

    /// As [`Camera::rest`].
    fn rest(&mut self);
}

/// Two cameras as one.
pub struct TwoEyes<E> {
    left: E,
    right: E,
    clock: Clock,
    info: SourceInfo,
    pairing: Pairing,
    /// The last picture of the right camera.
    right_color: ColorImage,
    /// Pairs given so far.
    given: u64,
    waited_ns: u64,
    /// Frames of the right camera without a partner.
    rights_alone: u64,
    /// How far apart in time the frames of pairs are taken.
    skews: Histogram,
}

/// Pairs after which the median of how far apart they are taken is logged.
const FIRST_PAIRS: u64 = 30;
/// Polls of the right camera in a row: one that never runs dry must not keep the left one waiting.
const MOST_POLLS: usize = 8;

impl<E: Eye> TwoEyes<E> {
    /// Pairs the frames of `left` and `right`, two cameras without end; ends after so many pairs, with `None` never.
    ///
    /// # Errors
    /// Their pictures are not of one size.
    pub fn new(left: E, right: E, clock: Clock, frames: Option<u64>) -> Result<Self, CaptureError> {
        let (ours, theirs) = (left.info(), right.info());
        if ours.size != theirs.size {
            let names = [ours.name, theirs.name];
            return Err(CaptureError::EyesDiffer { names, left: ours.size, right: theirs.size });
        }
        // Rates within 2 % count as one, such as 29.97 and 30.
        if ours.period_ns.abs_diff(theirs.period_ns) > ours.period_ns / 50 {
            let fps = |period_ns: u64| 1e9 / period_ns as f64;
            let (left_fps, right_fps) = (fps(ours.period_ns), fps(theirs.period_ns));
            tracing::warn!(
                "{} gives {left_fps:.1} frames a second and {} {right_fps:.1}: many will find no partner; choose a rate \
                 that both have with --fps",
                ours.name,
                theirs.name
            );
        }
        let info =
            SourceInfo { name: format!("{} and {}", ours.name, theirs.name), frames, brings: Brings::RightEye, ..ours };
        Ok(Self {
            pairing: Pairing::new(info.period_ns),
            left,
            right,
            clock,
            info,
            right_color: ColorImage::default(),
            given: 0,
            waited_ns: 0,
            rights_alone: 0,
            skews: Histogram::default(),
        })
    }

    /// Reads frames of the right camera until one is the partner of the left frame in hand. Returns how much later that
    /// one was taken, in nanoseconds; `None` where there is none in time.
    fn find_partner(&mut self) -> Option<i64> {
        let deadline_ns = self.clock.now_ns() + self.pairing.half_ns();
        let mut polls = 0;
        loop {
            match self.pairing.judge() {
                Verdict::Pair { skew_ns } => return Some(skew_ns),
                Verdict::LeftAlone | Verdict::NeedsLeft => return None,
                Verdict::RightAlone => self.rights_alone += 1,
                Verdict::NeedsRight => {}
            }
            let remaining_ns = deadline_ns.saturating_sub(self.clock.now_ns());
            // However late it is, the partner may be there already: one poll is always made.
            if remaining_ns == 0 && polls > 0 || polls == MOST_POLLS {
                self.pairing.give_up_left();
                return None;
            }
            polls += 1;
            let began_ns = self.clock.now_ns();
            match self.right.next_within(Duration::from_nanos(remaining_ns), &mut self.right_color) {
                Captured::Frame(stamp) => self.pairing.right(stamp.captured_ns.unwrap_or(began_ns)),
                Captured::Lost(count, cause) => {
                    tracing::debug!("{count} frames of the right camera were lost: {cause:?}");
                }
                Captured::Waiting | Captured::Corrupt(_) | Captured::End => {}
            }
            self.waited_ns += self.clock.now_ns() - began_ns;
        }
    }

    /// Counts how far apart a pair was taken, and logs the median once, after [`FIRST_PAIRS`].
    fn record_skew(&mut self, skew_ns: i64) {
        self.skews.add(skew_ns.unsigned_abs());
        if self.skews.samples() == FIRST_PAIRS {
            let median_ns = self.skews.percentile_ns(0.5);
            let line = format!("{}: the eyes are {:.1} ms apart", self.info.name, median_ns as f64 / 1e6);
            if median_ns > self.info.period_ns / 4 {
                tracing::warn!(
                    "{line}: depth of what moves will be wrong; cameras that are started by one signal help"
                );
            } else {
                tracing::info!("{line}");
            }
        }
    }
}

impl<E: Eye> Camera for TwoEyes<E> {
    fn info(&self) -> SourceInfo {
        self.info.clone()
    }

    fn next(&mut self, Shot { color, right, .. }: Shot) -> Result<Captured, CaptureError> {
        if self.info.frames.is_some_and(|frames| self.given >= frames) {
            return Ok(Captured::End);
        }
        let began_ns = self.clock.now_ns();
        let captured = self.left.next_within(PATIENCE, color);
        self.waited_ns = self.clock.now_ns() - began_ns;
        let Captured::Frame(stamp) = captured else { return Ok(captured) };
        self.pairing.left(stamp.captured_ns.unwrap_or(began_ns));
        Ok(match self.find_partner() {
            Some(skew_ns) => {
                right.set_luma_of(&self.right_color);
                self.record_skew(skew_ns);
                self.given += 1;
                Captured::Frame(stamp)
            }
            None => Captured::Lost(1, Cause::Unpaired),
        })
    }

    fn waited_ns(&self) -> u64 {
        self.waited_ns
    }

    fn rest(&mut self) {
        self.left.rest();
        self.right.rest();
        self.pairing.clear();
    }
}

impl<E> Drop for TwoEyes<E> {
    fn drop(&mut self) {
        let ms = |ns: u64| ns as f64 / 1e6;
        tracing::info!(
            "{}: {} pairs, {:.1} ms apart (at most {:.1}); {} frames of the right camera had no partner",
            self.info.name,
            self.given,
            ms(self.skews.percentile_ns(0.5)),
            ms(self.skews.max_ns()),
            self.rights_alone
        );
    }
}

#[cfg(test)]
mod tests;
