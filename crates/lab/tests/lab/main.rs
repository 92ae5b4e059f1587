//! The scene, and the modules that the benches measure with.
#![allow(missing_docs)]

mod governor;
mod leak;
mod quality;
mod scene;
mod stereo_recording;
