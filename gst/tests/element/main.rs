//! The element as GStreamer and its users see it.

mod common;
mod formats;
mod pads;
mod properties;
mod recording;
mod time;
