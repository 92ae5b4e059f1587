//! Defaults of the command line; those of a look are [`crate::look::Look::default`].

/// Disparities that the command `depth` tries of a pair of which no more is known.
pub const DISPARITIES: u32 = 64;
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
