//! Memory aligned to cache lines, so that no vector access crosses two of them.

use std::ops::{Deref, DerefMut};

/// Bytes of a cache line, and of the widest vector.
pub const CACHE_LINE_BYTES: usize = 64;

/// A fixed-size array aligned to a cache line.
#[derive(Default)]
pub struct Aligned<T = f32> {
    memory: Vec<T>,
    /// Index of the first value at a cache line boundary.
    start: usize,
    length: usize,
}

impl<T: Copy + Default> Aligned<T> {
    pub fn zeros(length: usize) -> Self {
        // Over-allocated by one line; a Vec that is never resized does not move.
        let memory = vec![T::default(); length + CACHE_LINE_BYTES / size_of::<T>()];
        let start = memory.as_ptr().align_offset(CACHE_LINE_BYTES).min(CACHE_LINE_BYTES / size_of::<T>());
        Self { memory, start, length }
    }
}

impl<T> Deref for Aligned<T> {
    type Target = [T];
    fn deref(&self) -> &[T] {
        &self.memory[self.start..self.start + self.length]
    }
}

impl<T> DerefMut for Aligned<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.memory[self.start..self.start + self.length]
    }
}

/// A local array aligned to a cache line.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct CacheAligned<T>(pub T);
