//! What people need who work on bokehcam: a scene with exact depth, rendered through a pinhole or a thin lens, and the
//! camera `synthetic` that films it; and what the rank of an aperture costs. The benches are in `benches/`.

pub mod aperture;
pub mod scene;
pub mod synthetic;
