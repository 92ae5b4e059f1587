//! Files for bokehcam: what they hold becomes the engine's pictures and maps.
//!
//! | layer | modules |
//! |---|---|
//! | 3 | [`depth`]: sources of depth, from recordings, maps, videos and networks |
//! | 2 | [`recording`]: recordings and photos, [`video`]: through ffmpeg, [`network`] |
//! | 1 | [`calibration`]: files of stereo cameras |
//! | 0 | [`layout`] of raw pictures, `files` (atomic writes, limited reads) |

pub mod calibration;
pub mod depth;
#[doc(hidden)]
pub mod files;
pub mod layout;
#[cfg(feature = "networks")]
pub mod network;
pub mod recording;
pub mod video;
