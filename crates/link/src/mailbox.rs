//! A one-slot mailbox: the newest item wins, and the receiver sleeps on an event.

use std::time::{Duration, Instant};

use super::event::AutoResetEvent;
use super::slot::{Reader, Writer, slot};
use super::sync::{Arc, AtomicBool, Ordering};
use super::{Abandoned, Received};

/// State shared by both ends, besides items.
struct Ends {
    event: AutoResetEvent,
    /// The sender is gone.
    ended: AtomicBool,
    /// The receiver is gone.
    abandoned: AtomicBool,
}

pub(super) fn mailbox<T>() -> (Sender<T>, Receiver<T>) {
    let (writer, reader) = slot();
    let ends = Ends { event: AutoResetEvent::new(), ended: AtomicBool::new(false), abandoned: AtomicBool::new(false) };
    let ends = Arc::new(ends);
    (Sender { writer, ends: ends.clone() }, Receiver { reader, ends })
}

pub(super) struct Sender<T> {
    writer: Writer<T>,
    ends: Arc<Ends>,
}

impl<T> Sender<T> {
    /// Stores `item` and wakes the receiver; returns the older item if it was not received.
    pub(super) fn send(&mut self, item: T) -> Result<Option<T>, Abandoned> {
        // Relaxed: it orders no other access. If it is seen late, one more item is in the slot, which drops it.
        if self.ends.abandoned.load(Ordering::Relaxed) {
            return Err(Abandoned);
        }
        let displaced = self.writer.put(item);
        // Only after the item is in the slot, or the receiver could wake, find nothing and sleep on.
        self.ends.event.set();
        Ok(displaced)
    }
}

impl<T> Drop for Sender<T> {
    fn drop(&mut self) {
        // Release: a thread that sees the flag sees the last item, too. The event is last, as for an item.
        self.ends.ended.store(true, Ordering::Release);
        self.ends.event.set();
    }
}

pub(super) struct Receiver<T> {
    reader: Reader<T>,
    ends: Arc<Ends>,
}

impl<T> Receiver<T> {
    pub(super) fn recv(&mut self) -> Option<T> {
        match self.recv_until(None) {
            Received::Item(item) => Some(item),
            Received::Nothing | Received::Ended => None,
        }
    }

    pub(super) fn recv_timeout(&mut self, patience: Duration) -> Received<T> {
        // A deadline beyond the range of the clock never comes.
        self.recv_until(Instant::now().checked_add(patience))
    }

    pub(super) fn try_recv(&mut self) -> Option<T> {
        self.reader.take()
    }

    /// Sleeps until there is an item, the sender is gone and its last item was received, or `deadline` has passed.
    fn recv_until(&mut self, deadline: Option<Instant>) -> Received<T> {
        loop {
            if let Some(item) = self.reader.take() {
                return Received::Item(item);
            }
            // Acquire: the last item was sent before. It may have come since the check above.
            if self.ends.ended.load(Ordering::Acquire) {
                return self.reader.take().map_or(Received::Ended, Received::Item);
            }
            if !self.ends.event.wait_until(deadline) {
                return Received::Nothing;
            }
        }
    }
}

impl<T> Drop for Receiver<T> {
    fn drop(&mut self) {
        self.ends.abandoned.store(true, Ordering::Relaxed);
    }
}
