//! A fixed set of buffers that circulate: taken by a stage, given back by being dropped.
//!
//! One atomic word has a bit for each buffer that is home. Taking clears one, giving back sets it: a bit says nothing
//! but whether that buffer is there, so a word that has changed and changed back (the ABA problem) misleads nobody.
//! Both are lock-free and neither allocates; giving back, in a stage or on its way out, never waits. A taker that
//! finds no buffer sleeps on a doorbell.
//!
//! # Memory orders
//! Giving back is a *release*, taking an *acquire* of the same word: what was done to a buffer, and its return to its
//! cell, come before it is taken again. Others that change the word in between do so by read-modify-writes, which carry
//! a release on.

use std::ops::{Deref, DerefMut};

use super::bell::Bell;
use super::sync::{Arc, AtomicU64, Ordering, UnsafeCell};

/// Most buffers of a [`Pool`]: the bits of a word.
pub const MOST_BUFFERS: usize = u64::BITS as usize;

/// A fixed set of equal buffers. Nothing is allocated after [`Pool::new`]. A buffer is moved when it is taken and given
/// back, so let it be a handle of its memory, such as a `Vec`.
pub struct Pool<T> {
    shared: Arc<Shared<T>>,
}

struct Shared<T> {
    /// Bit `n` is set while cell `n` holds its buffer.
    free: AtomicU64,
    cells: Box<[UnsafeCell<Option<T>>]>,
    bell: Bell,
}

// SAFETY: the cells are the only part that is not `Sync` by itself. A cell is accessed by the one thread that cleared
// its bit, until that or another thread to which the loan was moved sets it again (see `Memory orders`). Buffers are
// moved between threads, never shared, so `T: Send` suffices.
#[allow(unsafe_code)]
unsafe impl<T: Send> Sync for Shared<T> {}

impl<T> Pool<T> {
    /// A pool of `count` buffers, each made by `make`.
    ///
    /// # Panics
    /// `count` is more than [`MOST_BUFFERS`].
    pub fn new(count: usize, make: impl FnMut() -> T) -> Self {
        assert!(count <= MOST_BUFFERS, "a pool holds at most {MOST_BUFFERS} buffers, not {count}");
        let buffers = std::iter::repeat_with(make).take(count);
        let cells = buffers.map(|buffer| UnsafeCell::new(Some(buffer))).collect();
        let all = if count == 0 { 0 } else { u64::MAX >> (MOST_BUFFERS - count) };
        Self { shared: Arc::new(Shared { free: AtomicU64::new(all), cells, bell: Bell::new() }) }
    }

    /// A free buffer; sleeps until one comes home. A pool of none waits forever.
    pub fn take(&self) -> Pooled<T> {
        let mut woken = false;
        loop {
            if let Some((loan, left)) = self.claim() {
                // Of several takers only one hears the bell, however many buffers came home before it did. Those that
                // come home later ring for themselves.
                if woken && left != 0 {
                    self.shared.bell.ring();
                }
                return loan;
            }
            self.shared.bell.wait();
            woken = true;
        }
    }

    /// A free buffer, or nothing when all are out. Never waits.
    pub fn try_take(&self) -> Option<Pooled<T>> {
        self.claim().map(|(loan, _)| loan)
    }

    /// Buffers that are home now.
    pub fn free(&self) -> usize {
        self.shared.free.load(Ordering::Relaxed).count_ones() as usize
    }

    /// A free buffer, and the bits of those that are left.
    fn claim(&self) -> Option<(Pooled<T>, u64)> {
        // Relaxed: only a hint of which one to claim. A buffer whose bell this thread has heard is not overlooked.
        let mut free = self.shared.free.load(Ordering::Relaxed);
        while free != 0 {
            let left = free & (free - 1);
            // Acquire: what was done to the buffer, and its return, come first. Nothing is released: whatever is done
            // to it now, its return will. Where this fails, another thread got on.
            match self.shared.free.compare_exchange_weak(free, left, Ordering::Acquire, Ordering::Relaxed) {
                Ok(_) => {
                    let index = free.trailing_zeros() as usize;
                    let value = self.shared.cell(index, Option::take);
                    let home = Some(Home { shared: self.shared.clone(), index });
                    return Some((Pooled { value, home }, left));
                }
                Err(now) => free = now,
            }
        }
        None
    }
}

impl<T> Shared<T> {
    /// Only for who holds the loan `index`: its bit is clear, and it was this loan that cleared it.
    fn cell<R>(&self, index: usize, access: impl FnOnce(&mut Option<T>) -> R) -> R {
        self.cells[index].with_mut(|cell| {
            // SAFETY: called twice a loan: by the thread that has just cleared the bit, and by the loan's drop before
            // it sets the bit. Nobody else can clear it in between, so nobody else is at the cell; and the acquire
            // of the one follows the release of the other.
            #[allow(unsafe_code)]
            access(unsafe { &mut *cell })
        })
    }
}

/// A buffer on loan from a [`Pool`]; dropping it gives it back.
pub struct Pooled<T> {
    /// Empty only while the loan is being dropped.
    value: Option<T>,
    home: Option<Home<T>>,
}

/// Where a loan belongs; the buffers live as long as their pool or any loan of it.
struct Home<T> {
    shared: Arc<Shared<T>>,
    index: usize,
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
        if let Some(Home { shared, index }) = &self.home {
            shared.cell(*index, |cell| *cell = self.value.take());
            // Release: the buffer is home before it is free. Then the bell, or a taker could wake and find nothing.
            shared.free.fetch_or(1 << index, Ordering::Release);
            shared.bell.ring();
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
                // Asleep, as like as not.
                std::thread::sleep(std::time::Duration::from_millis(1));
                drop((first, second));
                drop(takers.map(|taker| taker.join()));
            });
            assert_eq!(pool.free(), 2);
        }
    }

    #[test]
    fn a_pool_holds_as_many_as_it_was_made_with() {
        for count in [0, 1, MOST_BUFFERS] {
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
