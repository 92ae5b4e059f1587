//! Files as sources and sinks.
#![allow(missing_docs)]

#[path = "../../../../tests/files/examples.rs"]
mod examples;
mod sinks;
mod video;
