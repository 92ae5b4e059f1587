//! One function per parser of bytes that others wrote: files, pictures of cameras, command lines. Whatever the bytes are,
//! it neither panics nor hangs, what it accepts keeps the parser's promises, and what it refuses it refuses in one line.
//!
//! libFuzzer calls these functions (`scripts/fuzz`), and so does a plain test over the seeds and mutations of them
//! (`tests/fuzz.rs`, which includes this file).

mod calibrations;
mod camera;
mod input;
mod pictures;
mod recordings;
mod texts;

pub use calibrations::{calibration, depth_calibration};
pub use camera::{mjpeg, raw_pixels};
pub use pictures::{pfm, picture, snapshot};
pub use recordings::recording;
pub use texts::{command_line, settings};

/// A target: takes any bytes, and panics where a promise is broken.
pub type Target = fn(&[u8]);

/// Every target by its name, which is also that of its folder of seeds.
pub const TARGETS: [(&str, Target); 10] = [
    ("calibration", calibration),
    ("command_line", command_line),
    ("depth_calibration", depth_calibration),
    ("mjpeg", mjpeg),
    ("pfm", pfm),
    ("picture", picture),
    ("raw_pixels", raw_pixels),
    ("recording", recording),
    ("settings", settings),
    ("snapshot", snapshot),
];
