//! The picture to measure with, and its exact depth: the synthetic scene.

use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::names::named;

use crate::error::CliError;

named! {
    /// The picture that is blurred.
    pub enum Scene default Sitter {
        /// A person in focus, and a room behind
        Sitter = "sitter",
        /// The same with objects in front, so that the hidden background is filled in
        Portrait = "portrait",
    }
}

/// Renders the first frame of the scene, one ray per pixel.
///
/// # Errors
/// Never fails in this configuration.
pub fn render_first_frame(scene: Scene, size: (u32, u32)) -> Result<(ColorImage, DepthMap), CliError> {
    use bokehcam_lab::scene::{Scene as Rendered, View};
    let scene_model = match scene {
        Scene::Sitter => Rendered::seated_person(),
        Scene::Portrait => Rendered::portrait(),
    };
    let (mut color, mut depth) = (ColorImage::default(), DepthMap::default());
    let threads = bokehcam::compute::thread_pool::core_count();
    scene_model.render_pinhole(&View::new(size.0, size.1), 0.0, 1, threads, &mut color, &mut depth);
    Ok((color, depth))
}
