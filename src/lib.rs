//! **bokehcam**: depth-aware, disc-shaped background blur. The engine: colour and depth in, blurred picture out.
//!
//! A picture with a depth map, in five lines:
//!
//! ```no_run
#![doc = include_str!("../examples/blur_a_picture.rs")]
//! ```
//!
//! The engine stands below the other crates, whose imports go down only:
//!
//! | crate | holds |
//! |---|---|
//! | `bokehcam-cli`, `bokehcam-window` | the program, and its live preview |
//! | `bokehcam-lab` | for developers: a scene with exact depth, and the benches |
//! | `bokehcam-live` | cameras, outputs, the threads of a run, sources by name, control of a running program |
//! | `bokehcam-media`, `bokehcam-video`, `bokehcam-networks` | recordings, photos and depth maps; videos; networks |
//! | `bokehcam-calibration`, `bokehcam-files` | files of stereo calibrations; files of users, whole and within limits |
//! | `bokehcam` | this engine |
//! | `bokehcam-link` | hand-over of frames between threads |
//!
//! Modules by layer: imports go down only, and modules of a layer do not import each other. Hidden modules are not part
//! of the public interface and may change with every version; `docs/developers.md` follows a frame through them.
//!
//! | layer | modules |
//! |---|---|
//! | 6 | [`engine`]: colour and depth in, blurred picture out |
//! | 5 | [`computing`]: CPU or GPU, for blur and matching |
//! | 4 | [`look`]: everything about the blur, for pictures of any size |
//! | 3 | [`depth`], [`bokeh`]: the two stages |
//! | 2 | `link` (the crate `bokehcam-link`), [`budget`] (the governor), `compute` (thread pool, SIMD, GPU device, free memory), [`calibration`] (and rectification) |
//! | 1 | [`color`] (curves and weights), [`frame`] (pictures and maps), [`optics`] (the lens), [`clock`] |
//! | 0 | `names`: enumerations whose values have names, help and an order |
//!
//! Conventions: a *circle of confusion* (CoC) is a **signed radius in pixels** of the input picture, positive behind
//! the focal plane; *disparity* is in pixels of the rectified left picture; depth is in metres; time is in nanoseconds
//! of a monotonic clock; blurring happens in linear light.
//!
//! `unsafe` is allowed in `compute/thread_pool.rs` and its `wavefront`, for a prefetch in `compute/simd.rs`, for
//! shaders without loop bounding in `compute/device.rs`, for the allocator in `compute/memory_limit.rs`, and in the crate
//! `bokehcam-link`, where each block has its safety argument. `scripts/prove-link` checks it with loom, Miri and ThreadSanitizer.

// What only the GPU needs is no reason for attributes of its own.
#![cfg_attr(not(feature = "gpu"), allow(dead_code, unused_imports))]

#[doc(hidden)]
pub use bokehcam_link as link;

pub mod bokeh;
pub mod budget;
pub mod calibration;
pub mod clock;
pub mod color;
#[doc(hidden)]
pub mod compute;
pub mod computing;
pub mod depth;
pub mod engine;
pub mod frame;
pub mod look;
#[doc(hidden)]
pub mod names;
pub mod optics;
