//! The scene, and what benches measure with.
#![allow(missing_docs)]

mod governor;
mod quality;
mod scene;
mod stereo_recording;
