//! The source `synthetic`: a camera that is rendered, which a program may bring along; this library has none.

use std::sync::OnceLock;

use super::{Camera, CaptureError};

/// What the synthetic camera makes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Format {
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Frames per second, > 0.
    pub fps: f64,
    /// End after so many frames, those passed over included; `None` never ends.
    pub frames: Option<u64>,
    /// Threads that render, > 0.
    pub threads: usize,
}

/// Makes a camera of a format.
///
/// # Errors
/// No camera has such pictures.
pub type Make = fn(Format) -> Result<Box<dyn Camera>, CaptureError>;

static MAKE: OnceLock<Make> = OnceLock::new();

/// From now on, `synthetic` is a camera that `make` makes. Only the first call counts.
pub fn bring(make: Make) {
    // Who comes later brings the same.
    let _ = MAKE.set(make);
}

/// The synthetic camera of a format.
///
/// # Errors
/// The program brought none, or it has no such pictures.
pub fn open(format: Format) -> Result<Box<dyn Camera>, CaptureError> {
    MAKE.get().ok_or(CaptureError::NoSynthetic)?(format)
}
