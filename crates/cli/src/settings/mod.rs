//! Settings, wherever they are said: which there are ([`table`]), arguments, environment, file, presets, which of them
//! holds ([`layers`]), and how they are printed and saved.

pub mod arguments;
pub mod changes;
#[cfg(feature = "window")]
pub mod command_line;
pub mod dump;
pub mod environment;
pub mod file;
pub mod layers;
pub mod look;
pub mod paths;
#[cfg(feature = "window")]
pub mod presets;
pub mod save;
pub mod table;
mod unknown;
pub mod unused;
