//! Tests on real drivers: the kernel's test camera `vivid` and `v4l2loopback`, in the virtual machine of `tests/vm/run`.
//!
//! `scripts/test` runs them where there can be such a machine. By hand:
//! `CARGO_TARGET_X86_64_UNKNOWN_LINUX_GNU_RUNNER="$PWD/tests/vm/run --" cargo test --test camera -- --include-ignored`
//!
//! Software emulation computes with floating point some fifty times slower than the processor: no speed of the blur is
//! measured here, and it is on for a few small frames only.
#![cfg(feature = "camera")]

mod demand;
mod devices;
mod faults;
mod formats;
mod knobs;
mod machine;
mod modes;
mod plate;
#[path = "../common/program.rs"]
mod program;
mod two_eyes;
mod virtual_camera;
