//! The link with a mutex and a condition variable: the obvious implementation, to compare with.

use std::sync::{Arc, Condvar, Mutex};

struct Slot<T> {
    item: Mutex<Option<T>>,
    filled: Condvar,
}

/// Both ends of the link.
pub struct Locked<T>(Arc<Slot<T>>);

impl<T> Locked<T> {
    pub fn pair() -> (Self, Self) {
        let slot = Arc::new(Slot { item: Mutex::new(None), filled: Condvar::new() });
        (Self(slot.clone()), Self(slot))
    }

    /// Sends an item; returns the older one that it displaced.
    pub fn send(&self, item: T) -> Option<T> {
        let displaced = self.0.item.lock().expect("no thread panics").replace(item);
        self.0.filled.notify_one();
        displaced
    }

    pub fn recv(&self) -> T {
        let mut item = self.0.item.lock().expect("no thread panics");
        loop {
            match item.take() {
                Some(item) => return item,
                None => item = self.0.filled.wait(item).expect("no thread panics"),
            }
        }
    }

    pub fn try_recv(&self) -> Option<T> {
        self.0.item.lock().expect("no thread panics").take()
    }
}
