//! A relay: memory that the parts of one pass work on one after the other, block by block, each following close behind
//! the one before it.

use std::cell::UnsafeCell;
use std::ops::{Deref, DerefMut};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

/// Blocks that go from part to part. All parts of a pass take all blocks, in the same order; a part has a block once the
/// part of the number before has passed it on. Parts are begun in the order of their numbers, so that whoever is waited
/// for is at work.
pub struct Relay<T> {
    blocks: Vec<Block<T>>,
}

/// A cache line of its own, so that waiting for one block does not slow work on another.
#[repr(align(64))]
struct Block<T> {
    /// Twice the number of the part that is next, and one more while it has the block.
    turn: AtomicUsize,
    value: UnsafeCell<T>,
}

// SAFETY: a block is used only by who raised its `turn` from even to odd, which one thread can, and until it is even
// again; that acquires what the part before released. `T: Send` as the parts run on several threads.
unsafe impl<T: Send> Sync for Relay<T> {}

impl<T> Relay<T> {
    /// Of these blocks.
    pub fn new(blocks: impl Iterator<Item = T>) -> Self {
        let block = |value| Block { turn: AtomicUsize::new(0), value: UnsafeCell::new(value) };
        Self { blocks: blocks.map(block).collect() }
    }

    /// Begins a pass, for which `prepare` is called with each block: part 0 is next everywhere.
    pub fn begin(&mut self, mut prepare: impl FnMut(&mut T)) {
        for Block { turn, value } in &mut self.blocks {
            *turn.get_mut() = 0;
            prepare(value.get_mut());
        }
    }

    /// What part number `part` takes the blocks by: once for each part of a pass, and before all else that it does, so
    /// that a panic passes them on.
    pub fn runner(&self, part: usize) -> Runner<'_, T> {
        Runner { relay: self, part, next: 0 }
    }
}

/// One part on its way through the blocks. Those that it has not taken when it is dropped go on untouched.
pub struct Runner<'a, T> {
    relay: &'a Relay<T>,
    part: usize,
    next: usize,
}

impl<'a, T> Runner<'a, T> {
    /// The next block, once the part before has passed it on; `None` after the last one.
    pub fn next_block(&mut self) -> Option<Turn<'a, T>> {
        let block = self.relay.blocks.get(self.next)?;
        self.next += 1;
        let due = 2 * self.part;
        let mut turns = 0u32;
        // Acquire pairs with the release of the part before.
        while block.turn.compare_exchange_weak(due, due + 1, Ordering::Acquire, Ordering::Relaxed).is_err() {
            while block.turn.load(Ordering::Relaxed) != due {
                turns += 1;
                if turns.is_multiple_of(256) { thread::yield_now() } else { std::hint::spin_loop() }
            }
        }
        Some(Turn { block })
    }
}

impl<T> Drop for Runner<'_, T> {
    fn drop(&mut self) {
        // A part that panicked must not keep the others waiting.
        while self.next_block().is_some() {}
    }
}

/// A block while a part has it.
pub struct Turn<'a, T> {
    block: &'a Block<T>,
}

impl<T> Deref for Turn<'_, T> {
    type Target = T;
    fn deref(&self) -> &T {
        // SAFETY: `turn` is odd, and it was this one that made it so.
        unsafe { &*self.block.value.get() }
    }
}

impl<T> DerefMut for Turn<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        // SAFETY: as above.
        unsafe { &mut *self.block.value.get() }
    }
}

impl<T> Drop for Turn<'_, T> {
    fn drop(&mut self) {
        // Release: the next part sees what this one wrote.
        self.block.turn.fetch_add(1, Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compute::thread_pool::ThreadPool;

    #[test]
    fn parts_take_each_block_in_order() {
        for threads in [1, 2, 5] {
            let mut workers = ThreadPool::new("test", threads);
            let mut relay = Relay::new((0..7).map(|_| Vec::new()));
            for parts in [1, 2, 40] {
                relay.begin(Vec::clear);
                workers.run(parts, &|part| {
                    let mut runner = relay.runner(part);
                    // Some leave blocks out.
                    while let Some(mut block) = runner.next_block().filter(|_| part % 5 != 3) {
                        block.push(part);
                    }
                });
                let all: Vec<usize> = (0..parts).filter(|part| part % 5 != 3).collect();
                relay.begin(|block| assert_eq!(*block, all, "{threads} threads, {parts} parts"));
            }
        }
    }

    #[test]
    fn a_part_that_panics_keeps_nobody_waiting() {
        let mut workers = ThreadPool::new("test", 3);
        let mut relay = Relay::new((0..4).map(|_| 0));
        relay.begin(|block| *block = 0);
        let pass = std::panic::AssertUnwindSafe(|| {
            workers.run(6, &|part| {
                let mut runner = relay.runner(part);
                while let Some(mut block) = runner.next_block() {
                    assert_ne!(part, 2);
                    *block += 1;
                }
            });
        });
        assert!(std::panic::catch_unwind(pass).is_err());
        // Whoever panicked takes no more parts; with the others alive, all else is done.
        relay.begin(|block| assert_eq!(*block, 5));
    }
}
