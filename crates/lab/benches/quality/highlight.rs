//! A single light on a plain wall, and the profile of its disc.

use bokehcam::color::srgb_to_linear;
use bokehcam::frame::ColorImage;
use glam::Vec2;

use super::lens::{Scene, Surface};
use super::scenes::SIZE;
use super::texture::{coverage_from_distance, disc_distance, premultiply, render_texture};

/// CoC radius of the wall and of the light, in pixels.
pub const COC_PX: f32 = 16.0;
/// Radius of the light, in pixels.
pub const LIGHT_PX: f32 = 4.0;
/// Code value of the wall.
const WALL: u8 = 60;
/// Width of a ring of the profile, in pixels.
const RING_PX: f32 = 0.5;

/// The profile of a disc.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Profile {
    /// Standard deviation of the inner disc in per cent of its mean.
    pub ripple_percent: f64,
    /// Distance over which the rim falls from 90 to 10 % of the plateau, in pixels.
    pub rim_px: f64,
    /// Darkest pixel below the wall, in per cent of the wall, beyond what rounding to 8 bits explains.
    pub lowest_percent: f64,
}

/// Returns a white light on a dark wall.
pub fn create_scene() -> Scene {
    let wall = srgb_to_linear(f32::from(WALL) / 255.0);
    let middle = Vec2::new((SIZE.0 - 1) as f32, (SIZE.1 - 1) as f32) / 2.0;
    let of = |p| {
        let alpha = coverage_from_distance(disc_distance(p, middle, LIGHT_PX));
        premultiply([wall + alpha * (1.0 - wall); 3], 1.0)
    };
    let surface = Surface { coc_px: COC_PX, slope: Vec2::ZERO, texture: render_texture(SIZE, 0, of), margin_px: 0 };
    let aperture = Default::default();
    Scene { width: SIZE.0, height: SIZE.1, coc_at_infinity_px: 1.25 * COC_PX, aperture, surfaces: vec![surface] }
}

/// Measures the disc in a picture of [`create_scene`].
pub fn measure_profile(image: &ColorImage) -> Profile {
    let light = |code: f32| f64::from(srgb_to_linear(code / 255.0));
    let wall = light(f32::from(WALL));
    let (width, middle) = (image.width as usize, Vec2::new((image.width - 1) as f32, (image.height - 1) as f32) / 2.0);
    let rings = (2.0 * (COC_PX + LIGHT_PX) / RING_PX) as usize;
    let mut profile = vec![(0.0, 0.0); rings];
    let mut inner = Vec::new();
    for (k, pixel) in image.rgb.chunks_exact(3).enumerate() {
        let distance_px = middle.distance(Vec2::new((k % width) as f32, (k / width) as f32));
        let value = light(f32::from(pixel[1])) - wall;
        if let Some(ring) = profile.get_mut((distance_px / RING_PX) as usize) {
            *ring = (ring.0 + value, ring.1 + 1.0);
        }
        if distance_px < 0.9 * (COC_PX - LIGHT_PX) {
            inner.push(value);
        }
    }
    let plateau = inner.iter().sum::<f64>() / inner.len() as f64;
    let variance = inner.iter().map(|value| (value - plateau).powi(2)).sum::<f64>() / inner.len() as f64;
    let means: Vec<(f64, f64)> = (0..rings)
        .filter(|&k| profile[k].1 > 0.0)
        .map(|k| ((k as f64 + 0.5) * f64::from(RING_PX), profile[k].0 / profile[k].1 / plateau))
        .collect();
    // The outermost radius where the profile still has a level, linear between rings.
    let falls_to = |level: f64| {
        let pair = means.windows(2).rev().find(|pair| pair[0].1 >= level && pair[1].1 < level);
        pair.map_or(0.0, |pair| {
            let ((near_px, high), (far_px, low)) = (pair[0], pair[1]);
            near_px + (far_px - near_px) * (high - level) / (high - low)
        })
    };
    let lowest = image.rgb.iter().copied().min().unwrap_or(WALL);
    let least = if lowest < WALL { light(f32::from(lowest) + 0.5) - wall } else { 0.0 };
    Profile {
        ripple_percent: 100.0 * variance.sqrt() / plateau,
        rim_px: falls_to(0.1) - falls_to(0.9),
        lowest_percent: 100.0 * least / wall,
    }
}
