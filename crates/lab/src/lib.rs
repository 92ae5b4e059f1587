//! Tools for developers of bokehcam: a scene with exact depth, rendered through a pinhole or a thin lens, the camera
//! `synthetic` that films it, an analysis of aperture ranks, and an attack on blurred backgrounds. The benches are in
//! `benches/`.

pub mod aperture;
pub mod leak;
pub mod scene;
pub mod synthetic;
