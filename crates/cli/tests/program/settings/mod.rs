//! Settings: effects, origins, saving, and messages.
#![allow(missing_docs)]

mod calib;
mod depth_map;
mod environment;
mod faults;
mod help;
mod messages;
mod names;
mod pictures;
mod radius;
mod save;
mod unused;
