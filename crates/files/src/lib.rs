//! Files of users: written atomically (whole or not at all), and read within limits; programs that convert others, and
//! where a desktop keeps what.

pub mod atomic_file;
pub mod data;
pub mod folder;
pub mod guardian;
pub mod input;
pub mod lock;
pub mod pipe_reader;
pub mod place;
pub mod process;
pub mod user_folders;
