//! **bokehcam**: depth-aware, disc-shaped background blur for cameras and RGB-D recordings.
//!
//! A frame goes one straight way, and only empty buffers come back:
//!
//! ```text
//! capture ──> depth ──> bokeh ──> sink
//!    colour     + depth    blurred   file, stream, window
//! ```
//!
//! The map of the house; imports go down only, and siblings do not know each other:
//!
//! | layer | modules |
//! |---|---|
//! | 7 | [`cli`]: arguments to one resolved configuration, one function per command |
//! | 6 | `preview`: the window |
//! | 5 | [`look`]: everything about the blur, for pictures of any size |
//! | 4 | [`pipeline`]: the one place that knows all stages |
//! | 3 | [`capture`], [`depth`], [`bokeh`], [`sink`] |
//! | 2 | [`link`], [`budget`], [`stats`], [`recording`], [`scene`], `v4l2` |
//! | 1 | [`compute`], [`calibration`] |
//! | 0 | [`frame`], [`optics`], [`clock`], [`files`] |
//!
//! Words: a *circle of confusion* (CoC) is a **signed radius in pixels** of the input picture, positive behind
//! the focal plane; *disparity* is in pixels of the rectified left picture; depth is in metres; time is in
//! nanoseconds of a monotonic clock; blurring happens in linear light.
//!
//! `unsafe` is allowed in `compute/team.rs`, `link/slot.rs`, `link/pool.rs` and under `v4l2`, where each block carries
//! its argument (and in `link/bell.rs` under Miri alone). `scripts/prove-link` runs what can be proved of it.

pub mod bokeh;
pub mod budget;
pub mod calibration;
pub mod capture;
pub mod cli;
pub mod clock;
pub mod compute;
pub mod depth;
pub mod files;
pub mod frame;
pub mod link;
pub mod look;
mod names;
pub mod optics;
pub mod pipeline;
#[cfg(feature = "window")]
pub mod preview;
pub mod recording;
pub mod scene;
pub mod sink;
pub mod stats;
#[cfg(feature = "camera")]
pub mod v4l2;
