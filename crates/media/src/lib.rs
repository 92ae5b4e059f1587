//! Files for bokehcam: what they hold becomes the engine's pictures and maps. [`recording`] reads and writes recordings,
//! photos and maps; [`video`] decodes through ffmpeg. Neither imports the other.

pub mod recording;
pub mod video;
