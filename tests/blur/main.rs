//! Properties of the blur, on the CPU and on a GPU.
#![allow(missing_docs)]

#[path = "../common/mod.rs"]
mod common;
#[cfg(feature = "gpu")]
#[path = "../common/on_gpu.rs"]
mod on_gpu;
#[path = "../common/portrait.rs"]
mod portrait;

mod banded;
mod laws;
mod laws_random;
mod occlusion;
mod parity;
mod privacy;
mod shaders;
mod shared_frame;
mod slices;
mod steady;
mod vectors;
