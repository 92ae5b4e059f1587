//! One slot, newest wins: a queue of one for the item, and a channel of one unit as the doorbell to sleep on.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crossbeam_channel::RecvTimeoutError;
use crossbeam_queue::ArrayQueue;

use super::{Abandoned, Received};

struct Slot<T> {
    item: ArrayQueue<T>,
    abandoned: AtomicBool,
}

pub(super) fn mailbox<T>() -> (Sender<T>, Receiver<T>) {
    let slot = Arc::new(Slot { item: ArrayQueue::new(1), abandoned: AtomicBool::new(false) });
    let (bell, ear) = crossbeam_channel::bounded(1);
    (Sender { slot: slot.clone(), bell }, Receiver { slot, ear })
}

pub(super) struct Sender<T> {
    slot: Arc<Slot<T>>,
    bell: crossbeam_channel::Sender<()>,
}

impl<T> Sender<T> {
    pub(super) fn send(&self, item: T) -> Result<Option<T>, Abandoned> {
        if self.slot.abandoned.load(Ordering::Acquire) {
            return Err(Abandoned);
        }
        let displaced = self.slot.item.force_push(item);
        // Only after the item lies in the slot, or the receiver could wake, find nothing and sleep on. A bell that is
        // already rung (full) will be heard; a bell without an ear is seen by the next send.
        let _ = self.bell.try_send(());
        Ok(displaced)
    }
}

pub(super) struct Receiver<T> {
    slot: Arc<Slot<T>>,
    ear: crossbeam_channel::Receiver<()>,
}

impl<T> Receiver<T> {
    pub(super) fn recv(&self) -> Option<T> {
        loop {
            if let Some(item) = self.slot.item.pop() {
                return Some(item);
            }
            if self.ear.recv().is_err() {
                // The sender is gone, and whatever it sent last happened before that.
                return self.slot.item.pop();
            }
        }
    }

    pub(super) fn recv_timeout(&self, patience: Duration) -> Received<T> {
        let deadline = Instant::now() + patience;
        loop {
            if let Some(item) = self.slot.item.pop() {
                return Received::Item(item);
            }
            match self.ear.recv_deadline(deadline) {
                Ok(()) => {}
                Err(RecvTimeoutError::Timeout) => return Received::Nothing,
                Err(RecvTimeoutError::Disconnected) => {
                    return self.slot.item.pop().map_or(Received::Ended, Received::Item);
                }
            }
        }
    }

    pub(super) fn try_recv(&self) -> Option<T> {
        self.slot.item.pop()
    }
}

impl<T> Drop for Receiver<T> {
    fn drop(&mut self) {
        self.slot.abandoned.store(true, Ordering::Release);
    }
}
