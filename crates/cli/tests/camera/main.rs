//! Tests with real drivers: the kernel's test camera `vivid`, `v4l2loopback`, and `uvcvideo` with an emulated USB webcam,
//! in the virtual machine of `tests/vm/run`.
//!
//! `scripts/test` runs them if that machine can run. By hand:
//! `CARGO_TARGET_X86_64_UNKNOWN_LINUX_GNU_RUNNER="$PWD/tests/vm/run --" cargo test --test camera -- --include-ignored`
//!
//! Emulated floating point is about 50 times slower than the processor's, so the blur's speed is not measured, and the
//! blur runs on a few small frames only.

mod demand;
mod devices;
#[cfg(feature = "pipewire")]
mod dma_buf;
mod faults;
mod formats;
mod knobs;
mod machine;
mod modes;
mod plate;
#[path = "../common/program.rs"]
mod program;
mod two_eyes;
mod usb;
mod usb_power;
mod usb_transfers;
mod virtual_camera;
mod webcam;
