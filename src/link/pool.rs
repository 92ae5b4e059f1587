//! A fixed set of buffers that circulate: taken by a stage, given back by being dropped.

use std::ops::{Deref, DerefMut};

use crossbeam_channel::{Receiver, Sender, bounded};

/// A fixed set of equal buffers. Nothing is allocated after [`Pool::new`].
pub struct Pool<T> {
    home: Receiver<T>,
    back: Sender<T>,
}

impl<T> Pool<T> {
    /// A pool of `count` buffers, each made by `make`.
    pub fn new(count: usize, make: impl FnMut() -> T) -> Self {
        let (back, home) = bounded(count);
        for buffer in std::iter::repeat_with(make).take(count) {
            // The channel has room for exactly `count`.
            let _ = back.try_send(buffer);
        }
        Self { home, back }
    }

    /// A free buffer; waits until one comes home.
    pub fn take(&self) -> Pooled<T> {
        let value = self.home.recv().ok();
        Pooled { value, home: Some(self.back.clone()) }
    }

    /// A free buffer, or nothing when all are out.
    pub fn try_take(&self) -> Option<Pooled<T>> {
        let value = self.home.try_recv().ok()?;
        Some(Pooled { value: Some(value), home: Some(self.back.clone()) })
    }
}

/// A buffer on loan from a [`Pool`]; dropping it sends it home.
pub struct Pooled<T> {
    value: Option<T>,
    home: Option<Sender<T>>,
}

impl<T> Pooled<T> {
    /// A buffer that belongs to no pool.
    pub fn detached(value: T) -> Self {
        Self { value: Some(value), home: None }
    }
}

impl<T> Deref for Pooled<T> {
    type Target = T;
    fn deref(&self) -> &T {
        self.value.as_ref().expect("a loan holds its buffer until it is dropped")
    }
}

impl<T> DerefMut for Pooled<T> {
    fn deref_mut(&mut self) -> &mut T {
        self.value.as_mut().expect("a loan holds its buffer until it is dropped")
    }
}

impl<T> Drop for Pooled<T> {
    fn drop(&mut self) {
        if let (Some(value), Some(home)) = (self.value.take(), &self.home) {
            // Fails only when the pool itself is gone; then the buffer goes too.
            let _ = home.try_send(value);
        }
    }
}
