//! Depth from cameras.

pub mod live;
