//! Cameras of PipeWire, with its daemons in a session of their own, and other programs as readers.
//!
//! `scripts/test` runs them where there are such daemons. By hand:
//! `tests/pipewire/session cargo test --test pipewire -- --include-ignored --test-threads=1`, with `--skip browsers::` where
//! there are none.
#![cfg(feature = "pipewire")]
#![allow(missing_docs)]

mod browsers;
mod camera;
mod delay;
#[cfg(feature = "camera")]
mod filter;
#[path = "../common/program.rs"]
mod program;
mod readers;
mod session;
#[cfg(feature = "camera")]
mod source;
mod without;
