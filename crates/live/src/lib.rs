//! Cameras, outputs, and the threads of a run of bokehcam.
//!
//! A stream flows in one direction; only empty buffers return:
//!
//! ```text
//! capture ──> depth ──> bokeh ──> sink
//!    colour     + depth    blurred   file, stream, window
//! ```
//!
//! [`source`] opens cameras and recordings by name, and [`pipeline`] runs them into a [`sink`].
//!
//! | layer | modules |
//! |---|---|
//! | 4 | `controller`: answers requests to a run, by the same code for a stream and a preview |
//! | 3 | [`source`]: cameras, recordings and their depth, by name |
//! | 2 | [`pipeline`]: the threads of a run |
//! | 1 | [`capture`], [`depth`] (of cameras and files), [`sink`]: what a run begins and ends with |
//! | 0 | [`stats`] (the report), `v4l2`, `pipewire`, `control` (the socket of `ctl`), [`camera_control`], [`layout`] of raw pictures |
//!
//! `unsafe` is allowed in `buffer.rs`, `log.rs`, `memory.rs` and `session.rs` of `pipewire`, and under `v4l2`, where each
//! block has its safety argument.

// What only a feature needs is no reason for attributes of its own.
#![cfg_attr(not(all(feature = "networks", feature = "pipewire")), allow(dead_code, unused_imports))]

pub mod camera_control;
pub mod capture;
#[doc(hidden)]
pub mod control;
#[doc(hidden)]
pub mod controller;
pub mod depth;
pub mod layout;
pub mod pipeline;
#[cfg(feature = "pipewire")]
#[doc(hidden)]
pub mod pipewire;
pub mod sink;
pub mod source;
pub mod stats;
#[cfg(feature = "camera")]
#[doc(hidden)]
pub mod v4l2;
