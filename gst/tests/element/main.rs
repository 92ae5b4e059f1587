//! The element as GStreamer and its users meet it.

mod common;
mod formats;
mod pads;
mod properties;
mod recording;
mod time;
