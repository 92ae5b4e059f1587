//! Files for bokehcam: what they hold becomes the engine's pictures and maps.
//!
//! | layer | modules |
//! |---|---|
//! | 3 | [`depth`]: sources of depth, from recordings, maps and videos |
//! | 2 | [`recording`]: recordings and photos, [`video`]: through ffmpeg |
//! | 1 | [`calibration`]: files of stereo cameras |
//! | 0 | [`layout`] of raw pictures |

pub mod calibration;
pub mod depth;
pub mod layout;
pub mod recording;
pub mod video;
