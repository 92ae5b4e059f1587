//! A frame on its way from stage to stage.

use super::Trace;
use crate::stats::{DropCause, FrameCounter, FrameTicket};
use bokehcam::frame::Stamp;
use bokehcam::link::{self, Sender};

/// A frame in the pipeline: its identity, its times, and its data at this point.
pub(super) struct Frame<T> {
    pub ticket: FrameTicket,
    pub stamp: Stamp,
    /// The number of the last seek ([`Seeker`](crate::capture::Seeker)) before it; 0 if there was none.
    pub seek: u64,
    /// Whether it is the target of that seek: it is shown however late it is.
    pub is_seek_target: bool,
    /// The number of the last change before it; 0 if there was none.
    pub change: u64,
    /// Whether the previous look's executor blurs it, because its own is still being created.
    pub is_transitional: bool,
    pub trace: Trace,
    /// When the previous stage finished it.
    pub since_ns: u64,
    pub item: T,
}

impl<T> Frame<T> {
    /// Starts the next stage at `now_ns`: separates the frame's data from the rest.
    pub fn take_item(self, now_ns: u64) -> (Frame<()>, T) {
        let Self { ticket, stamp, seek, is_seek_target, change, is_transitional, trace, item, .. } = self;
        (
            Frame { ticket, stamp, seek, is_seek_target, change, is_transitional, trace, since_ns: now_ns, item: () },
            item,
        )
    }

    /// Sends it to the next stage, and counts an older frame that it displaced; returns whether the output is still
    /// open.
    pub fn send_to(self, to: &mut Sender<Self>, counter: &FrameCounter) -> bool {
        match to.send(self) {
            Ok(None) => true,
            Ok(Some(older)) => {
                counter.count_dropped(older.ticket, DropCause::Evicted);
                true
            }
            // The frame's fate is unknown: it stays in flight.
            Err(link::Abandoned) => false,
        }
    }
}

impl Frame<()> {
    /// Returns the frame with its new data.
    pub fn with_item<T>(self, item: T) -> Frame<T> {
        let Self { ticket, stamp, seek, is_seek_target, change, is_transitional, trace, since_ns, item: () } = self;
        Frame { ticket, stamp, seek, is_seek_target, change, is_transitional, trace, since_ns, item }
    }
}
