//! Sources of depth that read files: of recordings, and of maps and videos of their own.

pub mod looped_recording;
pub mod map_sequence;
pub mod recorded;
pub mod video;
