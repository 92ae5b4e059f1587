//! User files: written atomically (whole or not at all), and read within limits.

pub mod atomic_file;
pub mod data;
pub mod folder;
pub mod input;
pub mod pipe_reader;
pub mod place;
pub mod trusted;
pub mod user_folders;
