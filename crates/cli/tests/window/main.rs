//! End-to-end tests of the preview window on a private X server, with synthetic input and screen captures.
//!
//! `scripts/test` runs them if `Xvfb` and `openbox` are installed (`scripts/setup window`). By hand: `cargo test --test
//! window -- --include-ignored --test-threads=1`; a failed test saves its screen in `target/tmp/`.

mod desktop;
mod harness;
mod input;
mod picture;
mod preview;
#[path = "../common/program.rs"]
mod program;
mod screen;
mod wayland;
mod window;

mod control;
mod keys;
mod life;
mod looks;
mod pictures;
mod size;
mod sources;
mod stays;
