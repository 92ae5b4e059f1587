//! Defaults of the command line; those of a look are [`crate::look::Look::default`].

use super::values::Size;

/// Units of a 16-bit depth picture per metre: the TUM convention.
pub const DEPTH_SCALE: f32 = 5000.0;
/// The same of depth cameras, most of which give millimetres.
#[cfg(feature = "camera")]
pub const LIVE_DEPTH_SCALE: f32 = 1000.0;
/// Value of a depth picture that means unknown.
pub const DEPTH_INVALID: &str = "0";
/// Disparities that the command `depth` tries of a pair of which no more is known.
pub const DISPARITIES: u32 = 64;
/// Picture size of the synthetic scene.
pub const SIZE: Size = Size { width: 640, height: 480 };
/// Frame rate of the synthetic scene.
pub const FPS: f64 = 30.0;
/// Apertures that the command `aperture` analyses.
pub const ANALYSED_APERTURES: &str = "disc,ring:0.5,polygon:5,polygon:6,polygon:8,heart,star:5";
/// Ranks that it shows.
pub const ANALYSED_RANKS: &str = "1,2,3,4,6,8";
/// Columns and rows of the kernels that it decomposes.
pub const ANALYSED_SIZE: &str = "65";
/// Picture sizes that the command `bench` measures.
pub const BENCHED_SIZES: &str = "640x480,1280x720,1920x1080";
/// Frames that it measures of each.
pub const BENCHED_FRAMES: u32 = 20;
