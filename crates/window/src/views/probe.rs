//! What is known of one pixel.

use super::sample::{depth_row, scaled};
use bokehcam::frame::DepthMap;
use bokehcam::optics::CocField;
use bokehcam::pipeline::View;

/// Depth and blur at a place of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// In metres; in units of the nearest where distances are only relative. `None` where it is unknown.
    pub depth_m: Option<f32>,
    /// The signed radius in pixels, positive behind the focal plane.
    pub coc_px: f32,
}

impl Probe {
    /// Of a frame, at fractions of its width and height.
    pub fn of(view: &View, [x, y]: [f32; 2]) -> Self {
        let (width, height) = view.picture.size();
        let pixel = |at: f32, side: u32| ((at * side as f32) as u32).min(side.saturating_sub(1));
        let (x, y) = (pixel(x, width), pixel(y, height));
        let there = |map: &DepthMap| {
            let row = depth_row(map, y, height);
            row[scaled(x, width, map.width) as usize]
        };
        let map = view.depth.as_deref().filter(|map| map.width > 0 && map.height > 0);
        let metres = map.map(there);
        let coc_px = match view.coc {
            CocField::Uniform { radius_px } => radius_px,
            CocField::Ramp(ramp) => ramp.coc_px(x as f32 + 0.5, y as f32 + 0.5),
            CocField::Depth(lens) => lens.coc_px(metres.unwrap_or(0.0)),
        };
        Self { depth_m: metres.filter(|&metres| DepthMap::is_known(metres)), coc_px }
    }
}
