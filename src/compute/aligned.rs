//! Memory that vectors can be read from and written to without touching two cache lines.

use std::ops::{Deref, DerefMut};

/// Bytes of a cache line, and of the widest vector.
const LINE: usize = 64;

/// A fixed number of values that starts at a cache line.
#[derive(Default)]
pub struct Aligned {
    memory: Vec<f32>,
    start: usize,
    length: usize,
}

impl Aligned {
    /// Zeros.
    pub fn zeros(length: usize) -> Self {
        // The allocation is longer than needed by a line, and never moves.
        let memory = vec![0.0; length + LINE / size_of::<f32>()];
        let start = memory.as_ptr().align_offset(LINE).min(LINE / size_of::<f32>());
        Self { memory, start, length }
    }
}

impl Deref for Aligned {
    type Target = [f32];
    fn deref(&self) -> &[f32] {
        &self.memory[self.start..self.start + self.length]
    }
}

impl DerefMut for Aligned {
    fn deref_mut(&mut self) -> &mut [f32] {
        &mut self.memory[self.start..self.start + self.length]
    }
}

/// A local array that starts at a cache line.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct Line<T>(pub T);
