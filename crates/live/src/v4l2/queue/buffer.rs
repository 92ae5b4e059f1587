//! A dequeued buffer's content, and the frames that were lost.

use std::ops::Deref;

/// Maximum number of planes of a buffer.
pub const MAX_PLANES: usize = v4l::v4l_sys::VIDEO_MAX_PLANES as usize;

/// A buffer that the kernel returned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dequeued {
    pub index: u32,
    pub sequence: u32,
    /// Capture time on the system's monotonic clock, if the driver uses that clock.
    pub stamp_ns: Option<u64>,
    /// Whether the driver reports damaged content.
    pub flagged: bool,
    /// The filled range of each plane.
    pub filled: [ByteRange; MAX_PLANES],
}

/// A range of bytes in a plane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ByteRange {
    pub start: usize,
    /// End of the range, exclusive.
    pub end: usize,
}

/// Frames that were not delivered, by cause.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    /// Dropped by the driver.
    pub missed: u64,
    /// Skipped because a newer one was available.
    pub stale: u64,
    /// Damaged, empty or truncated.
    pub corrupt: u64,
}

impl Losses {
    pub fn total(self) -> u64 {
        self.missed + self.stale + self.corrupt
    }
}

/// The filled ranges of a frame's planes.
#[derive(Clone, Copy, Debug)]
pub struct Planes<'a> {
    pub(super) planes: [&'a [u8]; MAX_PLANES],
    pub(super) count: usize,
}

impl<'a> Deref for Planes<'a> {
    type Target = [&'a [u8]];
    fn deref(&self) -> &Self::Target {
        &self.planes[..self.count]
    }
}
