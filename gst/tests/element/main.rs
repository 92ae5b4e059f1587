//! The element as GStreamer and its users meet it.
#![allow(missing_docs)]

mod common;
mod formats;
mod pads;
mod properties;
mod recording;
mod time;
