//! Depth and blur of a single pixel.

use super::coc_sampler::{depth_row, scale_index};
use bokehcam::frame::DepthMap;
use bokehcam::optics::CocField;
use bokehcam::pipeline::View;

/// Depth and blur at a point of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// Depth in metres, or in units of the nearest distance if depth is relative. `None` if unknown.
    pub depth_m: Option<f32>,
    /// Signed CoC radius in pixels, positive behind the focal plane.
    pub coc_px: f32,
}

impl Probe {
    /// Reads the values of a frame at fractions of its width and height.
    pub fn read(view: &View, [x, y]: [f32; 2]) -> Self {
        let (width, height) = view.picture.size();
        let pixel = |at: f32, side: u32| ((at * side as f32) as u32).min(side.saturating_sub(1));
        let (x, y) = (pixel(x, width), pixel(y, height));
        let depth_at = |map: &DepthMap| {
            let row = depth_row(map, y, height);
            row[scale_index(x, width, map.width) as usize]
        };
        let map = view.depth.as_deref().filter(|map| map.width > 0 && map.height > 0);
        let metres = map.map(depth_at);
        let coc_px = match view.coc {
            CocField::Uniform { radius_px } => radius_px,
            CocField::Ramp(ramp) => ramp.coc_px(x as f32 + 0.5, y as f32 + 0.5),
            CocField::Depth(lens) => lens.coc_px(metres.unwrap_or(0.0)),
        };
        Self { depth_m: metres.filter(|&metres| DepthMap::is_known(metres)), coc_px }
    }
}
