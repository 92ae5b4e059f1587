//! Frame accounting: captured = delivered + dropped (by cause) + in flight.

use std::sync::atomic::{AtomicU64, Ordering};

use serde::Serialize;

use bokehcam::frame::FrameId;

/// The cause of a dropped frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DropCause {
    /// The source had overwritten it before it was read.
    Driver,
    /// It could not be decoded.
    Corrupt,
    /// A newer frame replaced it in a link.
    Evicted,
    /// It was too old when it could be blurred.
    Late,
    /// It had no counterpart of another camera.
    Unpaired,
    /// A stage failed on it.
    Failed,
}

/// A frame in flight: created at capture, consumed when its fate is known.
#[derive(Debug)]
#[must_use = "a frame is delivered or dropped, never forgotten"]
pub struct FrameTicket {
    /// Index in the order of capture.
    pub id: FrameId,
    /// The capture time, on the run's clock.
    pub captured_ns: u64,
}

/// Counts frames from several threads. A [`FrameTicket`] is consumed when it is counted, so no frame counts twice.
#[derive(Debug, Default)]
pub struct FrameCounter {
    captured: AtomicU64,
    delivered: AtomicU64,
    dropped: [AtomicU64; 6],
    in_flight: AtomicU64,
}

impl FrameCounter {
    /// Creates a counter of zeros.
    pub fn new() -> Self {
        Self::default()
    }

    /// Counts a captured frame.
    pub fn count_captured(&self, captured_ns: u64) -> FrameTicket {
        self.in_flight.fetch_add(1, Ordering::Relaxed);
        FrameTicket { id: FrameId(self.captured.fetch_add(1, Ordering::Relaxed)), captured_ns }
    }

    /// Counts `count` frames that were lost before they were read.
    pub fn count_lost(&self, count: u64, cause: DropCause) {
        self.captured.fetch_add(count, Ordering::Relaxed);
        self.dropped[cause as usize].fetch_add(count, Ordering::Relaxed);
    }

    /// Counts a frame that reached the sink.
    pub fn count_delivered(&self, ticket: FrameTicket) {
        let FrameTicket { .. } = ticket;
        self.in_flight.fetch_sub(1, Ordering::Relaxed);
        self.delivered.fetch_add(1, Ordering::Relaxed);
    }

    /// Counts a dropped frame.
    pub fn count_dropped(&self, ticket: FrameTicket, cause: DropCause) {
        let FrameTicket { .. } = ticket;
        self.in_flight.fetch_sub(1, Ordering::Relaxed);
        self.dropped[cause as usize].fetch_add(1, Ordering::Relaxed);
    }

    /// Returns the current counts. While stages run, a frame may be missed; once they have ended, the counts are exact.
    pub fn frame_counts(&self) -> FrameCounts {
        let dropped = |cause: DropCause| self.dropped[cause as usize].load(Ordering::Relaxed);
        FrameCounts {
            captured: self.captured.load(Ordering::Relaxed),
            delivered: self.delivered.load(Ordering::Relaxed),
            dropped: DropCounts {
                driver: dropped(DropCause::Driver),
                corrupt: dropped(DropCause::Corrupt),
                evicted: dropped(DropCause::Evicted),
                late: dropped(DropCause::Late),
                unpaired: dropped(DropCause::Unpaired),
                failed: dropped(DropCause::Failed),
            },
            in_flight: self.in_flight.load(Ordering::Relaxed),
        }
    }
}

/// The counts of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct FrameCounts {
    /// Frames that the source produced, read or not.
    pub captured: u64,
    /// Frames that reached the sink.
    pub delivered: u64,
    /// Frames that did not reach the sink, by cause.
    pub dropped: DropCounts,
    /// Frames still in flight when the run ended; 0 unless a stage failed or the sink was closed from outside.
    pub in_flight: u64,
}

/// Dropped frames by [`DropCause`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DropCounts {
    /// [`DropCause::Driver`]
    pub driver: u64,
    /// [`DropCause::Corrupt`]
    pub corrupt: u64,
    /// [`DropCause::Evicted`]
    pub evicted: u64,
    /// [`DropCause::Late`]
    pub late: u64,
    /// [`DropCause::Unpaired`]
    pub unpaired: u64,
    /// [`DropCause::Failed`]
    pub failed: u64,
}

impl DropCounts {
    /// Returns the counts with the names of their causes, in the order of the report.
    pub fn by_cause(&self) -> [(&'static str, u64); 6] {
        [
            ("driver", self.driver),
            ("corrupt", self.corrupt),
            ("evicted", self.evicted),
            ("late", self.late),
            ("unpaired", self.unpaired),
            ("failed", self.failed),
        ]
    }

    /// Returns the sum over all causes.
    pub fn total(&self) -> u64 {
        self.by_cause().iter().map(|cause| cause.1).sum()
    }
}

impl FrameCounts {
    /// Returns whether captured = delivered + dropped + in flight.
    pub fn is_balanced(&self) -> bool {
        self.captured == self.delivered + self.dropped.total() + self.in_flight
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cause_has_its_own_count() {
        let counter = FrameCounter::new();
        let causes = [
            DropCause::Driver,
            DropCause::Corrupt,
            DropCause::Evicted,
            DropCause::Late,
            DropCause::Unpaired,
            DropCause::Failed,
        ];
        for (times, cause) in causes.into_iter().enumerate() {
            counter.count_lost(times as u64, cause);
            let ticket = counter.count_captured(0);
            counter.count_dropped(ticket, cause);
        }
        let frames = counter.frame_counts();
        assert_eq!(frames.dropped.by_cause().map(|cause| cause.1), [1, 2, 3, 4, 5, 6]);
        assert_eq!((frames.captured, frames.in_flight), (21, 0));
        assert!(frames.is_balanced());
    }

    #[test]
    fn a_frame_without_a_fate_is_in_flight() {
        let counter = FrameCounter::new();
        let (first, second) = (counter.count_captured(10), counter.count_captured(20));
        assert_eq!((first.id, second.id, second.captured_ns), (FrameId(0), FrameId(1), 20));
        counter.count_delivered(first);
        drop(second);
        let frames = counter.frame_counts();
        assert_eq!((frames.captured, frames.delivered, frames.in_flight), (2, 1, 1));
        assert!(frames.is_balanced());
        assert!(!FrameCounts { captured: 3, ..frames }.is_balanced());
    }
}
