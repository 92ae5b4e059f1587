//! Settings from all sources: their names ([`table`]), arguments, environment, file, presets, precedence ([`layers`]),
//! printing and saving.

pub mod arguments;
pub mod command_line;
pub mod dump;
pub mod environment;
pub mod file;
pub mod layers;
pub mod look;
pub mod paths;
pub mod presets;
pub mod save;
pub mod table;
mod unknown;
pub mod unused;
