//! A fixed set of buffers that circulate: taken by a stage, given back by being dropped.
//!
//! Buffers come home through a bounded `crossbeam_channel` with room for all of them, so giving one back never waits;
//! a mutex is touched only when somebody sleeps for a buffer.

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

    /// A free buffer; waits until one comes home. A pool of none waits forever.
    pub fn take(&self) -> Pooled<T> {
        // `recv` fails only when every sender is gone, and the pool holds one itself.
        let value = self.home.recv().ok();
        Pooled { value, home: Some(self.back.clone()) }
    }

    /// A free buffer, or nothing when all are out.
    pub fn try_take(&self) -> Option<Pooled<T>> {
        let value = self.home.try_recv().ok()?;
        Some(Pooled { value: Some(value), home: Some(self.back.clone()) })
    }

    /// Buffers that are home now.
    pub fn free(&self) -> usize {
        self.home.len()
    }
}

/// A buffer on loan from a [`Pool`]; dropping it sends it home.
pub struct Pooled<T> {
    /// Empty only while the loan is being dropped.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_circulate_and_are_made_once() {
        let mut made = 0;
        let pool = Pool::new(2, || {
            made += 1;
            vec![0u8; 4]
        });
        let (mut first, second) = (pool.take(), pool.take());
        assert!(pool.try_take().is_none(), "both are out");
        first[0] = 9;
        drop(first);
        assert_eq!(pool.take()[0], 9, "the same buffer, as it was left");
        drop(second);
        assert_eq!((pool.free(), made), (2, 2));
    }

    #[test]
    fn a_buffer_may_outlive_its_pool() {
        let pool = Pool::new(1, || 5);
        let loan = pool.take();
        drop(pool);
        assert_eq!(*loan, 5);
        assert_eq!(*Pooled::detached(6), 6);
    }
}
