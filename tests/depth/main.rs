//! Properties of depth and mattes, on the CPU and on a GPU.
#![allow(missing_docs)]

#[path = "../common/mod.rs"]
mod common;
#[cfg(feature = "gpu")]
#[path = "../common/on_gpu.rs"]
mod on_gpu;
#[path = "../common/portrait.rs"]
mod portrait;
#[path = "../common/room.rs"]
mod room;

mod background;
mod depth;
mod matcher;
mod matte_gpu;
mod matting;
mod plate;
mod rectify_gpu;
mod refine;
mod refine_gpu;
mod stereo_gpu;
mod stereo_tidying;
