//! Files for bokehcam: what recordings, photos and depth maps hold becomes the engine's pictures and maps.

pub mod recording;
