//! The scene, and the modules that the benches measure with.
#![allow(missing_docs)]

mod governor;
mod quality;
mod scene;
mod stereo_recording;
