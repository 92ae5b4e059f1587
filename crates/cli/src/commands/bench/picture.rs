//! The picture that is measured, with exact depth: the synthetic scene's, else the demonstration's.

use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::names::named;

use crate::error::CliError;

#[cfg(feature = "lab")]
named! {
    /// The picture that is blurred.
    pub enum Scene default Sitter {
        /// A person in focus, and a room behind
        Sitter = "sitter",
        /// The same with things in front, for which what they hide is filled in
        Portrait = "portrait",
    }
}

#[cfg(not(feature = "lab"))]
named! {
    /// The picture that is blurred.
    pub enum Scene default Demo {
        /// The first one of the demonstration
        Demo = "demo",
    }
}

/// The first frame of the scene, one ray per pixel.
///
/// # Errors
/// None.
#[cfg(feature = "lab")]
pub fn of(scene: Scene, size: (u32, u32)) -> Result<(ColorImage, DepthMap), CliError> {
    use bokehcam_lab::scene::{Scene as Rendered, View};
    let rendered = match scene {
        Scene::Sitter => Rendered::sitter(),
        Scene::Portrait => Rendered::portrait(),
    };
    let (mut color, mut depth) = (ColorImage::default(), DepthMap::default());
    let threads = bokehcam::compute::thread_pool::cores();
    rendered.render_pinhole(&View::new(size.0, size.1), 0.0, 1, threads, &mut color, &mut depth);
    Ok((color, depth))
}

/// The first frame of the demonstration: for each pixel the nearest of its own.
///
/// # Errors
/// The demonstration cannot be decoded.
#[cfg(not(feature = "lab"))]
pub fn of(_: Scene, (width, height): (u32, u32)) -> Result<(ColorImage, DepthMap), CliError> {
    use bokehcam::capture::{Camera, Shot, demo::Demo};
    let (mut of_demo, mut depth_of_demo) = (ColorImage::default(), DepthMap::default());
    Demo::new(Some(1))?.next(Shot {
        color: &mut of_demo,
        depth: &mut depth_of_demo,
        right: &mut Default::default(),
    })?;
    let (mut color, mut depth) = (ColorImage::new(width, height), DepthMap::new(width, height));
    let from = of_demo.size();
    let pixels = color.rgb.chunks_exact_mut(3).zip(&mut depth.metres);
    for (k, (rgb, metres)) in pixels.enumerate() {
        let (x, y) = (k as u32 % width, k as u32 / width);
        let nearest = (y * from.1 / height * from.0 + x * from.0 / width) as usize;
        rgb.copy_from_slice(&of_demo.rgb[nearest * 3..][..3]);
        *metres = depth_of_demo.metres[nearest];
    }
    Ok((color, depth))
}
