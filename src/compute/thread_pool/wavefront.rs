//! A pipelined wavefront: the parts of one pass process the same blocks of memory one after the other, each
//! part closely behind the previous one.

use std::cell::UnsafeCell;
use std::ops::{Deref, DerefMut};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

/// Blocks that are passed from part to part. All parts of a pass take all blocks in the same order; a part gets a block
/// once the previous part has released it. Parts start in the order of their numbers, so a part that is waited for is
/// already running.
pub struct Wavefront<T> {
    blocks: Vec<Block<T>>,
}

/// One cache line each, so that waiting for one block does not slow work on another (no false sharing).
#[repr(align(64))]
struct Block<T> {
    /// Twice the number of the next part, plus one while it holds the block.
    turn: AtomicUsize,
    value: UnsafeCell<T>,
}

// SAFETY: a block is used only by the part that raised its `turn` from even to odd, which one thread can, until it is
// even again; that acquires the release of the previous part. `T: Send` as the parts run on several threads.
unsafe impl<T: Send> Sync for Wavefront<T> {}

impl<T> Wavefront<T> {
    /// Creates a wavefront of these blocks.
    pub fn new(blocks: impl Iterator<Item = T>) -> Self {
        let block = |value| Block { turn: AtomicUsize::new(0), value: UnsafeCell::new(value) };
        Self { blocks: blocks.map(block).collect() }
    }

    /// Begins a pass and calls `prepare` with each block: part 0 is next everywhere.
    pub fn reset(&mut self, mut prepare: impl FnMut(&mut T)) {
        for Block { turn, value } in &mut self.blocks {
            *turn.get_mut() = 0;
            prepare(value.get_mut());
        }
    }

    /// Returns the iterator over the blocks for part number `part`: to be called once per part, before anything that
    /// may panic, so that a panic releases the blocks.
    pub fn block_iter(&self, part: usize) -> BlockIter<'_, T> {
        BlockIter { wavefront: self, part, next: 0 }
    }
}

/// Iterates over the blocks for one part. When dropped, it passes the remaining blocks on unchanged.
pub struct BlockIter<'a, T> {
    wavefront: &'a Wavefront<T>,
    part: usize,
    next: usize,
}

impl<'a, T> BlockIter<'a, T> {
    /// Waits for the next block until the previous part has released it; `None` after the last one.
    pub fn next_block(&mut self) -> Option<BlockGuard<'a, T>> {
        let block = self.wavefront.blocks.get(self.next)?;
        self.next += 1;
        let due = 2 * self.part;
        let mut turns = 0u32;
        // Acquire pairs with the release of the previous part.
        while block.turn.compare_exchange_weak(due, due + 1, Ordering::Acquire, Ordering::Relaxed).is_err() {
            while block.turn.load(Ordering::Relaxed) != due {
                turns += 1;
                if turns.is_multiple_of(256) { thread::yield_now() } else { std::hint::spin_loop() }
            }
        }
        Some(BlockGuard { block })
    }
}

impl<T> Drop for BlockIter<'_, T> {
    fn drop(&mut self) {
        // A part that panicked must not block the others.
        while self.next_block().is_some() {}
    }
}

/// A block held by a part.
pub struct BlockGuard<'a, T> {
    block: &'a Block<T>,
}

impl<T> Deref for BlockGuard<'_, T> {
    type Target = T;
    fn deref(&self) -> &T {
        // SAFETY: `turn` is odd, and this guard made it so.
        unsafe { &*self.block.value.get() }
    }
}

impl<T> DerefMut for BlockGuard<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        // SAFETY: as above.
        unsafe { &mut *self.block.value.get() }
    }
}

impl<T> Drop for BlockGuard<'_, T> {
    fn drop(&mut self) {
        // Release: the next part sees the writes of this one.
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
            let mut wavefront = Wavefront::new((0..7).map(|_| Vec::new()));
            for parts in [1, 2, 40] {
                wavefront.reset(Vec::clear);
                workers.run(parts, &|part| {
                    let mut block_iter = wavefront.block_iter(part);
                    // Some parts skip all blocks.
                    while let Some(mut block) = block_iter.next_block().filter(|_| part % 5 != 3) {
                        block.push(part);
                    }
                });
                let all: Vec<usize> = (0..parts).filter(|part| part % 5 != 3).collect();
                wavefront.reset(|block| assert_eq!(*block, all, "{threads} threads, {parts} parts"));
            }
        }
    }

    #[test]
    fn a_part_that_panics_keeps_nobody_waiting() {
        let mut workers = ThreadPool::new("test", 3);
        let mut wavefront = Wavefront::new((0..4).map(|_| 0));
        wavefront.reset(|block| *block = 0);
        let pass = std::panic::AssertUnwindSafe(|| {
            workers.run(6, &|part| {
                let mut block_iter = wavefront.block_iter(part);
                while let Some(mut block) = block_iter.next_block() {
                    assert_ne!(part, 2);
                    *block += 1;
                }
            });
        });
        assert!(std::panic::catch_unwind(pass).is_err());
        // The other parts are run all the same, whichever threads are awake.
        wavefront.reset(|block| assert_eq!(*block, 5));
    }
}
