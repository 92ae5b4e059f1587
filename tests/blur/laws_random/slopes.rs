//! Slopes before a wall: random surfaces whose CoC changes by less than a pixel per pixel, and the wall behind their
//! edge.

use super::cases::Random;
use super::common::{color, depth};
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::optics::DepthCoc;

/// Columns and rows.
pub const SIZE: (u32, u32) = (240, 180);
/// Margin in pixels beyond the blur radius of a silhouette that may still show the background: the grid of bounds is
/// coarse.
const BESIDE_PX: f32 = 17.0;

/// A surface in the lower part of the picture, and a wall behind it.
pub struct Slope {
    pub lens: DepthCoc,
    pub map: DepthMap,
    /// Whether all of it lies in front of the focal plane.
    pub is_in_front: bool,
    /// Whether the surface covers all that a pixel gathers from.
    pub alone: Vec<bool>,
    /// Dark and textured where the surface is.
    texture: Vec<u8>,
    is_wall: Vec<bool>,
}

impl Slope {
    /// A slope with waves, in front of the focus, behind it, or through it.
    pub fn new(random: &mut Random) -> Self {
        let (width, height) = (SIZE.0 as f32, SIZE.1 as f32);
        let max_px = 6.0 + 20.0 * random.share();
        // Tilted in any direction, with waves; their gradients sum up to less than one.
        let tilt = glam::Vec2::from_angle(7.0 * random.share()) * 0.45 * random.share();
        let wave = glam::Vec2::from_angle(7.0 * random.share()) * (0.03 + 0.1 * random.share());
        let steep = 0.5 * random.share();
        let (middle_px, phase) = (max_px * (1.6 * random.share() - 1.0), 7.0 * random.share());
        let coc_px = |x: u32, y: u32| {
            let at = glam::Vec2::new(x as f32 - width / 2.0, y as f32 - height / 2.0);
            (middle_px + tilt.dot(at) + steep / wave.length() * (wave.dot(at) + phase).sin())
                .clamp(-max_px, 0.6 * max_px)
        };
        let (edge, sway) = (height * (0.15 + 0.25 * random.share()), 12.0 * random.share());
        let is_wall = |x: u32, y: u32| (y as f32) < edge + sway * (x as f32 / 25.0).sin();
        // The wall lies behind all of the surface, by a larger step than within a continuous surface.
        let pixels = || (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y)));
        let farthest_px = pixels().map(|(x, y)| coc_px(x, y)).fold(f32::MIN, f32::max);
        let wall_px = if farthest_px < -3.0 { 0.0 } else { farthest_px + 2.0 + 0.2 * max_px };
        let lens = DepthCoc { coc_at_infinity_px: 2.0 * max_px, focus_m: 2.0, range_m: 0.0, max_coc_px: max_px };
        let metres = |coc_px: f32| lens.focus_m / (1.0 - coc_px.min(max_px) / lens.coc_at_infinity_px);
        let map = depth(SIZE.0, SIZE.1, |x, y| metres(if is_wall(x, y) { wall_px } else { coc_px(x, y) }));
        let edges: Vec<_> = pixels()
            .filter(|&(x, y)| !is_wall(x, y) && y > 0 && is_wall(x, y - 1))
            .map(|(x, y)| (x as f32, y as f32, coc_px(x, y).abs() + 1.0 + BESIDE_PX))
            .collect();
        let sees_wall = |x: u32, y: u32| {
            let beside = |&(at_x, at_y, px): &(f32, f32, f32)| (at_x - x as f32).hypot(at_y - y as f32) < px;
            is_wall(x, y) || edges.iter().any(beside)
        };
        let weave = [0; 3].map(|_| glam::Vec2::from_angle(7.0 * random.share()) * (0.1 + 0.2 * random.share()));
        let texture = pixels().map(|(x, y)| {
            let at = glam::Vec2::new(x as f32, y as f32);
            (32.0 + weave.iter().map(|wave| 4.0 * wave.dot(at).sin()).sum::<f32>()) as u8
        });
        Self {
            lens,
            map,
            is_in_front: farthest_px < 0.0,
            alone: pixels().map(|(x, y)| !sees_wall(x, y)).collect(),
            texture: texture.collect(),
            is_wall: pixels().map(|(x, y)| is_wall(x, y)).collect(),
        }
    }

    /// Returns the picture, with the wall in this code.
    pub fn image(&self, wall: u8) -> ColorImage {
        let at = |x: u32, y: u32| (y * SIZE.0 + x) as usize;
        color(SIZE.0, SIZE.1, |x, y| [if self.is_wall[at(x, y)] { wall } else { self.texture[at(x, y)] }; 3])
    }

    /// Returns the largest difference, in codes, of two pictures where the surface is alone, and its position.
    pub fn differ(&self, a: &ColorImage, b: &ColorImage) -> (u8, usize) {
        let pixels = a.rgb.chunks_exact(3).zip(b.rgb.chunks_exact(3)).enumerate().filter(|(at, _)| self.alone[*at]);
        pixels.map(|(at, (a, b))| (a[1].abs_diff(b[1]), at)).max().unwrap_or_default()
    }
}
