//! Video files, read by the programs ffmpeg and ffprobe as child processes.

pub mod command;
pub mod process;
