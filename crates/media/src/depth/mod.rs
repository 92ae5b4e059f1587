//! Sources of depth that read files: of recordings, of maps and videos of their own, and of networks.

pub mod looped_recording;
pub mod map_sequence;
pub mod recorded;
#[cfg(feature = "networks")]
pub mod single_camera;
pub mod video;
