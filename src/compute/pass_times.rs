//! Times of the passes of a frame.

use std::time::Duration;

/// Time per pass of one frame, in the order the passes ran. Fixed size, so that a frame allocates nothing.
#[derive(Clone, Copy, Debug)]
pub struct PassTimes {
    passes: [(&'static str, Duration); Self::CAPACITY],
    len: usize,
}

impl PassTimes {
    /// More than the number of distinct passes of any executor.
    const CAPACITY: usize = 16;

    /// Creates an empty list.
    pub fn new() -> Self {
        Self { passes: [("", Duration::ZERO); Self::CAPACITY], len: 0 }
    }

    /// Adds time to the pass `name`, which is the name of its file under `shaders/`.
    pub fn add(&mut self, name: &'static str, time: Duration) {
        if let Some(pass) = self.passes[..self.len].iter_mut().find(|pass| pass.0 == name) {
            pass.1 += time;
        } else if self.len < Self::CAPACITY {
            self.passes[self.len] = (name, time);
            self.len += 1;
        }
    }

    /// Returns pass names and times.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, Duration)> + '_ {
        self.passes[..self.len].iter().copied()
    }
}

impl Default for PassTimes {
    fn default() -> Self {
        Self::new()
    }
}
