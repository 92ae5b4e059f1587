//! **bokehcam**: depth-aware, disc-shaped background blur for cameras and RGB-D recordings.
//!
//! A picture with a depth map, in five lines:
//!
//! ```no_run
#![doc = include_str!("../examples/blur_a_picture.rs")]
//! ```
//!
//! A stream flows in one direction; only empty buffers return:
//!
//! ```text
//! capture ──> depth ──> bokeh ──> sink
//!    colour     + depth    blurred   file, stream, window
//! ```
//!
//! [`source`] opens cameras and recordings by name, [`look`] sets the appearance, and [`pipeline`] runs them into a
//! [`sink`]. `examples/` has a program for each: a picture, a stereo pair, a stream into a custom sink, a custom depth
//! source, and the low-rank kernels of an aperture.
//!
//! Modules by layer: imports go down only, and modules of a layer do not import each other. Hidden modules are not part
//! of the public interface and may change with every version; `docs/developers.md` follows a frame through them.
//!
//! | layer | modules |
//! |---|---|
//! | 10 | `controller`: answers requests to a run, by the same code for a stream and a preview |
//! | 9 | [`source`]: cameras, recordings and their depth, by name |
//! | 8 | [`pipeline`]: the threads of a run |
//! | 7 | [`engine`]: colour and depth in, blurred picture out |
//! | 6 | [`computing`]: CPU or GPU, for blur and matching |
//! | 5 | [`look`]: everything about the blur, for pictures of any size |
//! | 4 | [`capture`], [`depth`], [`bokeh`], [`sink`]: the four stages |
//! | 3 | `link` (the crate `bokehcam-link`), [`budget`] (the governor), [`network`], [`stats`] (the report), [`recording`], [`video`], `v4l2`, `pipewire`, `control` (the socket of `ctl`) |
//! | 2 | `compute` (thread pool, SIMD, GPU device, free memory), [`calibration`] (and rectification), [`layout`] (of raw pictures) |
//! | 1 | [`color`] (curves and weights), [`frame`] (pictures and maps), [`optics`] (the lens), [`clock`], [`camera_control`], `files` (atomic writes) |
//! | 0 | `names`: enumerations whose values have names, help and an order |
//!
//! Conventions: a *circle of confusion* (CoC) is a **signed radius in pixels** of the input picture, positive behind
//! the focal plane; *disparity* is in pixels of the rectified left picture; depth is in metres; time is in nanoseconds
//! of a monotonic clock; blurring happens in linear light.
//!
//! `unsafe` is allowed in `compute/thread_pool.rs` and its `wavefront`, for a prefetch in `compute/simd.rs`, for
//! shaders without loop bounding in `compute/device.rs`, for the allocator in `compute/memory_limit.rs`, in `pipewire/buffer.rs`, `pipewire/log.rs`,
//! `pipewire/session.rs`, under `v4l2`, and in the crate `bokehcam-link`, where each block has its safety argument.
//! `scripts/prove-link` checks it with loom, Miri and ThreadSanitizer.

#[doc(hidden)]
pub use bokehcam_link as link;

pub mod bokeh;
pub mod budget;
pub mod calibration;
pub mod camera_control;
#[cfg(feature = "files")]
pub mod capture;
pub mod clock;
pub mod color;
#[doc(hidden)]
pub mod compute;
pub mod computing;
#[cfg(feature = "files")]
#[doc(hidden)]
pub mod control;
#[cfg(feature = "files")]
#[doc(hidden)]
pub mod controller;
pub mod depth;
pub mod engine;
#[cfg(feature = "files")]
#[doc(hidden)]
pub mod files;
pub mod frame;
pub mod layout;
pub mod look;
#[doc(hidden)]
pub mod names;
#[cfg(feature = "networks")]
pub mod network;
pub mod optics;
#[cfg(feature = "files")]
pub mod pipeline;
#[cfg(feature = "pipewire")]
#[doc(hidden)]
pub mod pipewire;
#[cfg(feature = "files")]
pub mod recording;
#[cfg(feature = "files")]
pub mod sink;
#[cfg(feature = "files")]
pub mod source;
#[cfg(feature = "files")]
pub mod stats;
#[cfg(feature = "camera")]
#[doc(hidden)]
pub mod v4l2;
#[cfg(feature = "files")]
pub mod video;
