//! Files of users: written whole or not at all, and read within bounds.

pub mod data;
pub mod folder;
pub mod input;
pub mod place;
pub mod trusted;
pub mod user_folders;
pub mod whole;
