//! Tools for developers of bokehcam: a scene with exact depth, rendered through a pinhole or a thin lens, the camera
//! `synthetic` that films it, and an analysis of aperture ranks. The benches are in `benches/`.

pub mod aperture;
pub mod scene;
pub mod synthetic;
