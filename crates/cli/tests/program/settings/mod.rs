//! Settings as the user of the program meets them: which have an effect, where they come from, how they are saved, and
//! how what is said of them looks.
#![allow(missing_docs)]

mod calib;
mod depth_map;
mod environment;
mod help;
mod messages;
mod names;
mod pictures;
mod radius;
mod save;
mod unused;
