//! The preview's window as a person has it: a real one on an X server of its own, driven by real keys and pointers, and
//! seen by what is on the screen.
//!
//! `scripts/test` runs them where there is `Xvfb` and `openbox` (`scripts/setup window` installs both). By hand:
//! `cargo test --test window -- --include-ignored --test-threads=1`; what a failed test saw lies in `target/tmp/`.

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
