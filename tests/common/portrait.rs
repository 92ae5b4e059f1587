//! The bundled portrait.
#![allow(dead_code, missing_docs)]

use std::path::PathBuf;

use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::recording::{Options, Recording, Scratch};

pub fn folder() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/recordings/portrait"))
}

/// Reads a picture, its depth and its time.
pub fn frame(index: usize) -> (ColorImage, DepthMap, u64) {
    let recording = Recording::open(&folder(), &Options::default()).expect("it is bundled");
    let (mut scratch, mut color, mut map) = (Scratch::default(), ColorImage::default(), DepthMap::default());
    recording.read_color(index, &mut scratch, &mut color).expect("a picture");
    recording.read_depth(index, &mut scratch, &mut map).expect("its depth");
    (color, map, recording.time_ns(index))
}
