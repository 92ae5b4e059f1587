//! Sources of depth: cameras, recordings, and maps and videos of their own.

#[cfg(feature = "camera")]
pub mod live;
pub mod looped_recording;
pub mod map_sequence;
pub mod recorded;
pub mod video;
