//! What came in a buffer, and what did not.

use std::ops::Deref;

/// Most planes of a buffer.
pub const MAX_PLANES: usize = v4l::v4l_sys::VIDEO_MAX_PLANES as usize;

/// A buffer that the kernel gave back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dequeued {
    pub index: u32,
    pub sequence: u32,
    /// When the frame was taken, on the system's monotonic clock, where the driver uses that.
    pub stamp_ns: Option<u64>,
    /// The driver says that its content is damaged.
    pub flagged: bool,
    /// What of each plane was filled.
    pub parts: [Part; MAX_PLANES],
}

/// Part of a plane, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Part {
    pub start: usize,
    /// The byte after its last.
    pub end: usize,
}

/// Frames that were not given out, by cause.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    /// The driver dropped them.
    pub missed: u64,
    /// Passed over, as a newer one was there.
    pub stale: u64,
    /// Damaged, empty or cut short.
    pub corrupt: u64,
}

impl Losses {
    pub fn total(self) -> u64 {
        self.missed + self.stale + self.corrupt
    }
}

/// The planes of a frame, as far as they are filled.
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
