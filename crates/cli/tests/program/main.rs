//! End-to-end tests of the `bokehcam` program.
#![allow(missing_docs)]

#[path = "../../../../tests/common/mod.rs"]
mod common;
#[path = "../../../../tests/common/onnx.rs"]
mod onnx;
#[path = "../../../../tests/common/planes.rs"]
mod planes;
#[path = "../common/program.rs"]
mod program;
#[path = "../../../../tests/common/room.rs"]
mod room;
#[cfg(feature = "window")]
#[path = "../../../../tests/common/store.rs"]
mod store;

mod batch;
mod behind;
mod cli;
mod colors;
mod ctl;
mod damage;
#[cfg(all(feature = "gpu", feature = "lab"))]
mod depth_on_gpu;
mod disparity;
// Its commands take every part that packages bring.
#[cfg(feature = "packaged")]
mod documents;
mod fit;
#[cfg(feature = "camera")]
mod fuzz;
mod gpu_faults;
mod heic;
mod map_sequences;
#[cfg(feature = "networks")]
mod networks;
mod orientation;
mod outputs;
mod packaging;
mod plate;
mod presets;
mod preview;
mod record;
mod render;
mod settings;
mod stereo;
mod terminal;
mod video_meaning;
mod videos;
