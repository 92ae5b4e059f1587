//! One function per parser of untrusted bytes: files, pictures of cameras, command lines. For any input, a parser must
//! neither panic nor hang, accepted input must keep its guarantees, and an error must be one line.
//!
//! libFuzzer (`scripts/fuzz`) calls these functions, and so does a plain test with the seeds and mutations of them
//! (`crates/cli/tests/program/fuzz.rs`, which includes this file).

use std::panic;

use bokehcam::compute::is_catching_panics;

mod calibrations;
mod camera;
mod input;
mod pictures;
mod recordings;
mod texts;

pub use calibrations::{calibration, depth_calibration};
pub use camera::{mjpeg, raw_pixels};
pub use pictures::{depth_map, embedded_depth, picture, snapshot};
pub use recordings::{recording, recording_file};
pub use texts::{command_line, settings};

/// Lets panics pass that a caller catches, such as those of libraries: libFuzzer's own hook aborts at any.
pub fn spare_caught_panics() {
    let abort = panic::take_hook();
    panic::set_hook(Box::new(move |info| {
        if !is_catching_panics() {
            abort(info);
        }
    }));
}

/// A fuzz target: accepts any bytes, and panics on a broken guarantee.
pub type Target = fn(&[u8]);

/// Every target with its name, which is also that of its folder of seeds.
pub const TARGETS: [(&str, Target); 12] = [
    ("calibration", calibration),
    ("command_line", command_line),
    ("depth_calibration", depth_calibration),
    ("depth_map", depth_map),
    ("embedded_depth", embedded_depth),
    ("mjpeg", mjpeg),
    ("picture", picture),
    ("raw_pixels", raw_pixels),
    ("recording", recording),
    ("recording_file", recording_file),
    ("settings", settings),
    ("snapshot", snapshot),
];
