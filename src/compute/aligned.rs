//! Memory that vectors can be read from and written to without touching two cache lines.

use std::ops::{Deref, DerefMut};

/// Bytes of a cache line, and of the widest vector.
pub const LINE: usize = 64;

/// A fixed number of values that starts at a cache line.
#[derive(Default)]
pub struct Aligned<T = f32> {
    memory: Vec<T>,
    /// The first value that begins a cache line.
    start: usize,
    length: usize,
}

impl<T: Copy + Default> Aligned<T> {
    pub fn zeros(length: usize) -> Self {
        // The allocation is longer than needed by a line, and never moves.
        let memory = vec![T::default(); length + LINE / size_of::<T>()];
        let start = memory.as_ptr().align_offset(LINE).min(LINE / size_of::<T>());
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

/// A local array that starts at a cache line.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct Line<T>(pub T);
