//! The picture to measure with, and its exact depth: the demonstration, in a build without the synthetic scene.

use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::names::named;

use crate::error::CliError;

named! {
    /// The picture that is blurred.
    pub enum Scene default Demo {
        /// The first picture of the demonstration
        Demo = "demo",
    }
}

/// Returns the first frame of the demonstration, resampled to nearest neighbours.
///
/// # Errors
/// Fails if the demonstration cannot be decoded.
pub fn render_first_frame(_: Scene, (width, height): (u32, u32)) -> Result<(ColorImage, DepthMap), CliError> {
    use bokehcam_live::capture::{Camera, FrameBuffers, demo::Demo};
    let (mut demo_color, mut demo_depth) = (ColorImage::default(), DepthMap::default());
    Demo::new(Some(1))?.next(FrameBuffers {
        color: &mut demo_color,
        depth: &mut demo_depth,
        right: &mut Default::default(),
    })?;
    let (mut color, mut depth) = (ColorImage::new(width, height), DepthMap::new(width, height));
    let demo_size = demo_color.size();
    let pixels = color.rgb.chunks_exact_mut(3).zip(&mut depth.metres);
    for (k, (rgb, metres)) in pixels.enumerate() {
        let (x, y) = (k as u32 % width, k as u32 / width);
        let nearest = (y * demo_size.1 / height * demo_size.0 + x * demo_size.0 / width) as usize;
        rgb.copy_from_slice(&demo_color.rgb[nearest * 3..][..3]);
        *metres = demo_depth.metres[nearest];
    }
    Ok((color, depth))
}
