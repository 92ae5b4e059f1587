//! The bundled portrait.
#![allow(dead_code, missing_docs)]

use std::path::{Path, PathBuf};

use bokehcam::frame::{ColorImage, DepthMap};

/// Returns its folder, for tests of every package.
pub fn folder() -> PathBuf {
    let mut folders =
        Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().map(|folder| folder.join("recordings/portrait"));
    folders.find(|folder| folder.exists()).expect("it is bundled")
}

/// Reads a picture, its depth and its time.
pub fn frame(index: usize) -> (ColorImage, DepthMap, u64) {
    let open = |kind: &str| image::open(folder().join(kind).join(format!("{index:06}.png"))).expect("a picture");
    let (color, units) = (open("rgb").into_rgb8(), open("depth").into_luma16());
    let (width, height) = color.dimensions();
    let metres = units.pixels().map(|units| f32::from(units.0[0]) / 5000.0).collect();
    let color = ColorImage { width, height, rgb: color.into_raw() };
    (color, DepthMap { width, height, metres, ..DepthMap::default() }, time_ns(index))
}

fn time_ns(index: usize) -> u64 {
    let list = std::fs::read_to_string(folder().join("rgb.txt")).expect("a list");
    let line = list.lines().filter(|line| !line.starts_with('#')).nth(index).expect("as many frames");
    let seconds: f64 = line.split(' ').next().and_then(|time| time.parse().ok()).expect("a time");
    (seconds * 1e9).round() as u64
}
