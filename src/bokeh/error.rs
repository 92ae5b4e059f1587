//! Errors of the blur.

use crate::compute::GpuError;

/// Why a frame could not be blurred.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum BokehError {
    /// The effect needs a depth map and the frame has none.
    #[error("the effect dof needs depth, and the frame has none")]
    NoDepth,
    /// The size of the picture differs from that of the executor.
    #[error("the executor was made for {made_for:?} pixels, the frame has {got:?}")]
    Size { made_for: (u32, u32), got: (u32, u32) },
    /// The blur is wider than the picture, or than the method supports.
    #[error(
        "a blur radius of {radius_px} px is too large: {} at most {max_px} px; lower --max-coc or --blur",
        if *by_method { "for --method gather, \
                         use".to_owned() } else { format!("for pictures of {}x{}, use", size.0, size.1) }
    )]
    TooWide {
        radius_px: f32,
        /// [`max_radius_px`](super::Settings::max_radius_px).
        max_px: f32,
        size: (u32, u32),
        /// True if the method sets the limit.
        by_method: bool,
    },
    /// A picture needs more memory than is free.
    #[error(
        "a picture of {}x{} pixels takes about {needed_mb} MB to blur, and only {free_mb} MB are free: make it \
         smaller, or close other programs",
        size.0, size.1
    )]
    Memory { size: (u32, u32), needed_mb: u64, free_mb: u64 },
    /// The lengths of slices do not match the picture.
    #[error("slices of {lengths:?} values for pixels, result and radii do not fit a picture of {size:?}")]
    Lengths {
        size: (u32, u32),
        /// Lengths of the pixels, the result and the radii.
        lengths: [usize; 3],
    },
    /// Only colours are returned here, and the result has alpha, too.
    #[error(
        "--behind transparent: only `render` to PNG and `stream` to DIR/ (PNG), FILE.webm and FILE.mov write an alpha \
         channel; use a colour"
    )]
    Transparent,
    /// The executor accepted a picture and returned no result.
    #[error("the blur returned no picture: please report this")]
    Lost,
    /// There is no GPU, or it refused or was lost.
    #[error(transparent)]
    Gpu(#[from] GpuError),
}
