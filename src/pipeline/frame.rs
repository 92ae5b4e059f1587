//! A frame on its way from stage to stage.

use super::Trace;
use crate::frame::Stamp;
use crate::link::{self, Sender};
use crate::stats::{Cause, Tally, Ticket};

/// A frame on its way: what identifies it, what it took, and what there is of it at this point.
pub(super) struct Frame<T> {
    pub ticket: Ticket,
    pub stamp: Stamp,
    /// The number of the last wish of a [`Seeker`](crate::capture::Seeker) before it; 0 where there was none.
    pub seek: u64,
    /// Whether it is the frame of that wish: it is shown however late it is.
    pub is_wished: bool,
    /// The number of the last change before it; 0 where there was none.
    pub change: u64,
    /// Whether it is blurred by the executor of the look before, as its own is still being made.
    pub is_between: bool,
    pub trace: Trace,
    /// When the last stage was through with it.
    pub since_ns: u64,
    pub item: T,
}

impl<T> Frame<T> {
    /// The next stage takes it up, for which it has waited until now: the frame without what there is of it, and that.
    pub fn taken_up(self, now_ns: u64) -> (Frame<()>, T) {
        let Self { ticket, stamp, seek, is_wished, change, is_between, mut trace, since_ns, item } = self;
        trace.between_ns += now_ns.saturating_sub(since_ns);
        (Frame { ticket, stamp, seek, is_wished, change, is_between, trace, since_ns: now_ns, item: () }, item)
    }

    /// Hands it on, and counts an older one that it displaced; returns whether there is anybody to take more.
    pub fn hand_on(self, to: &mut Sender<Self>, tally: &Tally) -> bool {
        match to.send(self) {
            Ok(None) => true,
            Ok(Some(older)) => {
                tally.dropped(older.ticket, Cause::Evicted);
                true
            }
            // Nobody knows the frame's fate: it stays in flight.
            Err(link::Abandoned) => false,
        }
    }
}

impl Frame<()> {
    /// The frame with what has become of it.
    pub fn with<T>(self, item: T) -> Frame<T> {
        let Self { ticket, stamp, seek, is_wished, change, is_between, trace, since_ns, item: () } = self;
        Frame { ticket, stamp, seek, is_wished, change, is_between, trace, since_ns, item }
    }
}
