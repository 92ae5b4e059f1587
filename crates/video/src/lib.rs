//! Video files, decoded by the programs ffmpeg and ffprobe as child processes.
//!
//! [`VideoFile`] says what a file contains, and [`Decoder`] reads its pictures in order. ffmpeg rotates and scales them
//! and converts their colours; it opens no other file and no network for that.

#[doc(hidden)]
pub mod command;
mod completeness;
mod decoder;
mod encryption;
mod error;
mod probe;

pub use decoder::{Conversion, Decoded, Decoder, Pixels};
pub use error::VideoError;
pub use probe::VideoFile;

/// Largest width and height of the pictures of videos and cameras, in pixels.
pub const MAX_SIDE_PX: u32 = 8192;
