//! Transfer of frames between threads, and the return of buffers.
//!
//! A link has one sender and one receiver, and comes in two kinds behind one interface:
//!
//! - [`live`]: a one-slot mailbox in which the newest item wins. Sending never waits; an item that was not read in time
//!   is returned to the sender, which counts it.
//! - [`lossless`]: a short queue. Sending waits for room, so nothing is lost and every replay is the same.
//!
//! Dropping the sender is the end of the stream: pending items are still delivered. Dropping the receiver makes the
//! next send fail with [`Abandoned`].
//!
//! # Progress guarantees
//! On a live link and in a pool, no thread ever holds a lock that another one has to wait for:
//!
//! - Sending and polling for an item are *wait-free*: a fixed number of steps, one atomic swap that moves the item and
//!   one for the event, independent of the other end and of the scheduler (`slot.rs`).
//! - Taking and returning a buffer are *lock-free*: a buffer's bit is cleared by a compare-and-swap that is retried
//!   only if another thread has just succeeded, and set by one instruction ([`pool`]).
//! - None of this allocates, and none calls the kernel, with one exception: sending an item, or returning a buffer, to
//!   a sleeping thread makes one system call to wake it (`event.rs`). There is no mutex on that path either.
//!
//! Two operations wait by design: a reader without an item and a taker without a buffer sleep in the kernel (`futex`)
//! until there is one. A live run has buffers for every place along its way, so its capture never waits.
//!
//! The lossless link is not lock-free: a bounded `crossbeam_channel`. Without sleepers it moves items by atomic
//! operations, but a thread suspended in the middle of moving one blocks that place of the ring; a thread that goes to
//! sleep registers under a mutex, which its waker takes as well; and its sender waits for room. It serves files, which
//! have no deadline.
//!
//! # Verification
//! Each memory order has its reason beside it. The models in `models.rs` are run by loom in every order of the threads
//! up to a number of preemptions; `crates/link/tests/handover.rs` counts a million frames, and
//! `crates/window/tests/allocation` counts allocations. `scripts/prove-link` runs loom, and Miri and ThreadSanitizer where
//! the toolchain has them.
//! `cargo bench --bench handover` compares with a mutex and a condition variable.

pub mod demand;
mod event;
mod mailbox;
pub mod pool;
mod slot;
mod sync;

use std::time::Duration;

use crossbeam_channel::{RecvTimeoutError, SendTimeoutError};

/// The receiver is gone: no item will be read, and pending ones are dropped with the sender.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the next stage is gone")]
pub struct Abandoned;

/// Capacity of a lossless link: an item that is ready while the receiver works on another. More would take memory, and
/// no stage is faster for it.
pub const LOSSLESS_ITEMS: usize = 1;

/// Result of waiting for an item.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received<T> {
    /// The next item.
    Item(T),
    /// Timed out.
    Nothing,
    /// The sender is gone and nothing is pending.
    Ended,
}

/// Result of sending an item.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sent<T> {
    /// Sent.
    Taken,
    /// Sent, and displaced this older item (live links only).
    Displaced(T),
    /// Timed out without room; returns the item (lossless links only).
    Full(T),
}

/// Creates a link in which the newest item wins and sending never waits.
pub fn live<T>() -> (Sender<T>, Receiver<T>) {
    let (sender, receiver) = mailbox::mailbox();
    (Sender(Tx::Live(sender)), Receiver(Rx::Live(receiver)))
}

/// Creates a link that loses nothing: sending waits while [`LOSSLESS_ITEMS`] are pending.
pub fn lossless<T>() -> (Sender<T>, Receiver<T>) {
    let (sender, receiver) = crossbeam_channel::bounded(LOSSLESS_ITEMS);
    (Sender(Tx::Lossless(sender)), Receiver(Rx::Lossless(receiver)))
}

/// The sending end of a link. Dropping it ends the stream.
pub struct Sender<T>(Tx<T>);

enum Tx<T> {
    Live(mailbox::Sender<T>),
    Lossless(crossbeam_channel::Sender<T>),
}

impl<T> Sender<T> {
    /// Sends `item`. Returns the older item that it displaced, if any (live links only).
    ///
    /// # Errors
    /// The receiver is gone; `item` is dropped.
    pub fn send(&mut self, item: T) -> Result<Option<T>, Abandoned> {
        match &mut self.0 {
            Tx::Live(mailbox) => mailbox.send(item),
            Tx::Lossless(queue) => queue.send(item).map(|()| None).map_err(|_| Abandoned),
        }
    }

    /// Same as [`Sender::send`], but waits for room for at most `patience`.
    ///
    /// # Errors
    /// The receiver is gone; `item` is dropped.
    pub fn send_timeout(&mut self, item: T, patience: Duration) -> Result<Sent<T>, Abandoned> {
        match &mut self.0 {
            Tx::Live(mailbox) => Ok(mailbox.send(item)?.map_or(Sent::Taken, Sent::Displaced)),
            Tx::Lossless(queue) => match queue.send_timeout(item, patience) {
                Ok(()) => Ok(Sent::Taken),
                Err(SendTimeoutError::Timeout(item)) => Ok(Sent::Full(item)),
                Err(SendTimeoutError::Disconnected(_)) => Err(Abandoned),
            },
        }
    }
}

/// The receiving end of a link.
pub struct Receiver<T>(Rx<T>);

enum Rx<T> {
    Live(mailbox::Receiver<T>),
    Lossless(crossbeam_channel::Receiver<T>),
}

impl<T> Receiver<T> {
    /// Waits for the next item. `None` once the sender is gone and nothing is pending.
    pub fn recv(&mut self) -> Option<T> {
        match &mut self.0 {
            Rx::Live(mailbox) => mailbox.recv(),
            Rx::Lossless(queue) => queue.recv().ok(),
        }
    }

    /// Waits for the next item, for at most `patience`.
    pub fn recv_timeout(&mut self, patience: Duration) -> Received<T> {
        match &mut self.0 {
            Rx::Live(mailbox) => mailbox.recv_timeout(patience),
            Rx::Lossless(queue) => match queue.recv_timeout(patience) {
                Ok(item) => Received::Item(item),
                Err(RecvTimeoutError::Timeout) => Received::Nothing,
                Err(RecvTimeoutError::Disconnected) => Received::Ended,
            },
        }
    }

    /// Returns the next item if it is pending.
    pub fn try_recv(&mut self) -> Option<T> {
        match &mut self.0 {
            Rx::Live(mailbox) => mailbox.try_recv(),
            Rx::Lossless(queue) => queue.try_recv().ok(),
        }
    }
}

#[cfg(all(test, loom))]
mod models;
#[cfg(all(test, not(loom)))]
mod tests;
