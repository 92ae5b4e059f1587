//! The source `synthetic`, a rendered camera. The application registers its implementation; this library has none.

use std::sync::OnceLock;

use super::{Camera, CaptureError};

/// Parameters of the synthetic camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Format {
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Frames per second, > 0.
    pub fps: f64,
    /// Number of frames until the end, skipped ones included; `None` never ends.
    pub frames: Option<u64>,
    /// Number of rendering threads, > 0.
    pub threads: usize,
}

/// Creates a camera.
///
/// # Errors
/// The camera does not support this format.
pub type CameraFactory = fn(Format) -> Result<Box<dyn Camera>, CaptureError>;

static FACTORY: OnceLock<CameraFactory> = OnceLock::new();

/// Registers `factory` as the implementation of `synthetic`. Only the first call has an effect.
pub fn register_factory(factory: CameraFactory) {
    // Later callers register the same function.
    let _ = FACTORY.set(factory);
}

/// Opens the synthetic camera.
///
/// # Errors
/// No implementation is registered, or it does not support this format.
pub fn open_camera(format: Format) -> Result<Box<dyn Camera>, CaptureError> {
    FACTORY.get().ok_or(CaptureError::NoSynthetic)?(format)
}
