//! Recordings on disk.

pub mod tum;

mod encode;
mod error;
mod whole;

pub use error::{LineFault, PictureFault, RecordingError};

/// Pictures with more columns or rows are refused from their header, before memory is taken for them.
const MAX_SIDE_PX: u32 = 8192;

/// A depth map covers the view of its colour picture when it is not larger and has the same aspect, within a pixel.
fn depth_covers(depth: (u32, u32), color: (u32, u32)) -> bool {
    let (depth_width, depth_height) = (u64::from(depth.0), u64::from(depth.1));
    let (width, height) = (u64::from(color.0), u64::from(color.1));
    let skew = (depth_width * height).abs_diff(depth_height * width);
    (1..=width).contains(&depth_width) && (1..=height).contains(&depth_height) && skew <= width.max(height)
}

fn check_depth_scale(depth_scale: f32) -> Result<(), RecordingError> {
    if depth_scale > 0.0 && depth_scale.is_finite() { Ok(()) } else { Err(RecordingError::DepthScale(depth_scale)) }
}
