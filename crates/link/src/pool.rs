//! A fixed set of reusable buffers: taken by a stage, returned by being dropped.
//!
//! One atomic word has a bit for each free buffer. Taking clears it, returning sets it: a bit only says whether that
//! buffer is free, so a word that has changed and changed back (the ABA problem) is harmless. Both are lock-free and
//! neither allocates; returning never waits. A taker without a free buffer sleeps on an event.
//!
//! # Memory orders
//! Returning is a *release*, taking an *acquire* of the same word: all writes to a buffer, and its return to its cell,
//! happen before it is taken again. Other changes of the word in between are read-modify-writes, which continue the
//! release sequence.

use std::ops::{Deref, DerefMut};

use super::event::AutoResetEvent;
use super::sync::{Arc, AtomicU64, Ordering, UnsafeCell};

/// Largest number of buffers of a [`Pool`]: the bits of a word.
pub const MAX_BUFFERS: usize = u64::BITS as usize;

/// A fixed set of equal buffers. Nothing is allocated after [`Pool::new`]. A buffer is moved when it is taken and
/// returned, so it should be a handle of its memory, such as a `Vec`.
pub struct Pool<T> {
    shared: Arc<Shared<T>>,
}

struct Shared<T> {
    /// Bit `n` is set while cell `n` holds its buffer.
    free: AtomicU64,
    cells: Box<[UnsafeCell<Option<T>>]>,
    event: AutoResetEvent,
}

// SAFETY: the cells are the only part that is not `Sync` by itself. A cell is accessed by the one thread that cleared
// its bit, until that or another thread to which the loan was moved sets it again (see `Memory orders`). Buffers are
// moved between threads, never shared, so `T: Send` suffices.
#[allow(unsafe_code)]
unsafe impl<T: Send> Sync for Shared<T> {}

impl<T> Pool<T> {
    /// Creates a pool of `count` buffers, each made by `make`.
    ///
    /// # Panics
    /// `count` is more than [`MAX_BUFFERS`].
    pub fn new(count: usize, make: impl FnMut() -> T) -> Self {
        assert!(count <= MAX_BUFFERS, "a pool holds at most {MAX_BUFFERS} buffers, not {count}");
        let buffers = std::iter::repeat_with(make).take(count);
        let cells = buffers.map(|buffer| UnsafeCell::new(Some(buffer))).collect();
        let all = if count == 0 { 0 } else { u64::MAX >> (MAX_BUFFERS - count) };
        Self { shared: Arc::new(Shared { free: AtomicU64::new(all), cells, event: AutoResetEvent::new() }) }
    }

    /// Takes a free buffer; sleeps until one is returned. A pool without buffers waits forever.
    pub fn take(&self) -> Pooled<T> {
        let mut woken = false;
        loop {
            if let Some((loan, left)) = self.claim() {
                // However many buffers were returned, the rings before this one woke only one of several takers.
                // Buffers returned later set the event again.
                if woken && left != 0 {
                    self.shared.event.set();
                }
                return loan;
            }
            self.shared.event.wait();
            woken = true;
        }
    }

    /// Takes a free buffer, if any. Never waits.
    pub fn try_take(&self) -> Option<Pooled<T>> {
        self.claim().map(|(loan, _)| loan)
    }

    /// Returns the number of free buffers.
    pub fn free(&self) -> usize {
        self.shared.free.load(Ordering::Relaxed).count_ones() as usize
    }

    /// Takes a free buffer; also returns the bits of the remaining ones.
    fn claim(&self) -> Option<(Pooled<T>, u64)> {
        // Relaxed: only a hint of which one to claim. The buffer whose return woke this thread is visible.
        let mut free = self.shared.free.load(Ordering::Relaxed);
        while free != 0 {
            let left = free & (free - 1);
            // Acquire: the writes to the buffer, and its return, happen before. Nothing is released here: the return
            // will do that. On failure, another thread made progress.
            match self.shared.free.compare_exchange_weak(free, left, Ordering::Acquire, Ordering::Relaxed) {
                Ok(_) => {
                    let index = free.trailing_zeros() as usize;
                    let value = self.shared.cell(index, Option::take);
                    let origin = Some(Origin { shared: self.shared.clone(), index });
                    return Some((Pooled { value, origin }, left));
                }
                Err(now) => free = now,
            }
        }
        None
    }
}

impl<T> Shared<T> {
    /// Accesses cell `index`; only for the holder of this loan: its bit is clear, and this loan cleared it.
    fn cell<R>(&self, index: usize, access: impl FnOnce(&mut Option<T>) -> R) -> R {
        self.cells[index].with_mut(|cell| {
            // SAFETY: called twice per loan: by the thread that has just cleared the bit, and by the loan's drop before
            // it sets the bit. No other thread can clear it in between, so no other thread accesses the cell; and the
            // acquire of the first follows the release of the previous loan.
            #[allow(unsafe_code)]
            access(unsafe { &mut *cell })
        })
    }
}

/// A buffer on loan from a [`Pool`]; dropping it returns it.
pub struct Pooled<T> {
    /// Empty only while the loan is being dropped.
    value: Option<T>,
    origin: Option<Origin<T>>,
}

/// Origin of a loan; the buffers live as long as their pool or any loan of it.
struct Origin<T> {
    shared: Arc<Shared<T>>,
    index: usize,
}

impl<T> Pooled<T> {
    /// Creates a buffer that belongs to no pool.
    pub fn detached(value: T) -> Self {
        Self { value: Some(value), origin: None }
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
        if let Some(Origin { shared, index }) = &self.origin {
            shared.cell(*index, |cell| *cell = self.value.take());
            // Release: the buffer is in its cell before it is free. Then the event, or a taker could wake and find
            // nothing.
            shared.free.fetch_or(1 << index, Ordering::Release);
            shared.event.set();
        }
    }
}

#[cfg(all(test, not(loom)))]
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
    fn who_waits_for_a_buffer_is_woken_when_one_comes_home() {
        let pool = Pool::new(2, || ());
        for _ in 0..20 {
            let [first, second] = [(); 2].map(|()| pool.try_take().expect("both are home"));
            std::thread::scope(|scope| {
                let takers = [(); 2].map(|()| scope.spawn(|| pool.take()));
                // Most likely asleep.
                std::thread::sleep(std::time::Duration::from_millis(1));
                drop((first, second));
                drop(takers.map(|taker| taker.join()));
            });
            assert_eq!(pool.free(), 2);
        }
    }

    #[test]
    fn a_pool_holds_as_many_as_it_was_made_with() {
        for count in [0, 1, MAX_BUFFERS] {
            let pool = Pool::new(count, || ());
            assert_eq!(pool.free(), count);
            let loans: Vec<_> = std::iter::from_fn(|| pool.try_take()).collect();
            assert_eq!((loans.len(), pool.free()), (count, 0));
        }
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
