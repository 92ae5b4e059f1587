//! PipeWire cameras, with the daemons in a private session, and other programs as readers.
//!
//! `scripts/test` runs them if the daemons are installed. By hand: `crates/cli/tests/pipewire/session cargo test --test
//! pipewire -- --include-ignored --test-threads=1`, with `--skip browsers::` if there are no browsers.
#![allow(missing_docs)]

mod browsers;
mod camera;
mod delay;
mod dma_buf;
mod filter;
#[cfg(feature = "window")]
#[path = "../../../../tests/common/heard.rs"]
mod heard;
mod own_memory;
#[cfg(feature = "window")]
mod preview;
#[path = "../common/program.rs"]
mod program;
mod readers;
mod session;
mod source;
#[cfg(feature = "window")]
#[path = "../../../../tests/common/store.rs"]
mod store;
mod without;
