//! Procedural textures and outlines of the scenes, from distances and hashes: reproducible on every machine.

use glam::Vec2;

use super::lens::Rgba;
use super::picture::{Plane, Rgb};

/// A small pseudorandom generator (PCG's multiplier; the high bits are used).
pub struct Rng(u64);

impl Rng {
    /// Creates the sequence of a seed.
    pub fn new(seed: u64) -> Self {
        let mut rng = Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x1234_5678_9ABC_DEF1);
        rng.next();
        rng
    }

    /// Returns a uniformly distributed number from 0 to below 1.
    pub fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }

    /// Returns a uniformly distributed number from `low` to `high`.
    pub fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.next()
    }

    /// Returns a standard normal number (Box and Muller).
    pub fn normal(&mut self) -> f32 {
        let radius = (-2.0 * (1.0 - self.next()).ln()).sqrt();
        radius * (std::f32::consts::TAU * self.next()).cos()
    }
}

/// Returns the random value of a lattice point, 0 to 1.
fn hash_lattice_point(x: i32, y: i32, seed: u32) -> f32 {
    let mut h =
        (x as u32).wrapping_mul(0x85EB_CA6B) ^ (y as u32).wrapping_mul(0xC2B2_AE35) ^ seed.wrapping_mul(0x27D4_EB2F);
    h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
    h = (h ^ (h >> 12)).wrapping_mul(0x297A_2D39);
    (h ^ (h >> 15)) as f32 / u32::MAX as f32
}

/// Returns smooth noise with a feature every `pitch` pixels, 0 to 1.
fn value_noise(p: Vec2, pitch: f32, seed: u32) -> f32 {
    let q = p / pitch;
    let cell = q.floor();
    let f = q - cell;
    let f = f * f * (Vec2::splat(3.0) - 2.0 * f);
    let (x, y) = (cell.x as i32, cell.y as i32);
    let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
    let top = mix(hash_lattice_point(x, y, seed), hash_lattice_point(x + 1, y, seed), f.x);
    let bottom = mix(hash_lattice_point(x, y + 1, seed), hash_lattice_point(x + 1, y + 1, seed), f.x);
    mix(top, bottom, f.y)
}

/// Returns noise of six octaves from 96 to 3 pixels, 0 to 1, mean about one half.
pub fn fractal_noise(p: Vec2, seed: u32) -> f32 {
    let (mut sum, mut weights, mut weight, mut pitch) = (0.0, 0.0, 1.0, 96.0);
    for octave in 0..6 {
        sum += weight * value_noise(p, pitch, seed.wrapping_add(octave * 101));
        weights += weight;
        (weight, pitch) = (weight * 0.7, pitch / 2.0);
    }
    ((sum / weights - 0.5) * 1.9 + 0.5).clamp(0.0, 1.0)
}

/// The pattern of a surface.
#[derive(Clone, Copy, Debug)]
pub enum Pattern {
    /// Noise alone.
    Noise,
    /// A chessboard with this many pixels a square.
    Checks(f32),
    /// Diagonal stripes this many pixels wide.
    Stripes(f32),
}

/// Returns a tinted pattern in linear light, about 0.03 to 0.9.
pub fn pattern_color(p: Vec2, tint: Rgb, pattern: Pattern, seed: u32) -> Rgb {
    let noise = fractal_noise(p, seed);
    // A border one pixel wide between light and dark, so that the pattern is band-limited.
    let wave = |t: f32, period: f32| {
        let from_edge = (t / period).rem_euclid(2.0) - 1.0;
        ((0.5 - from_edge.abs()) * period + 0.5).clamp(0.0, 1.0)
    };
    let shade = match pattern {
        Pattern::Noise => 1.0,
        Pattern::Checks(px) => {
            let (a, b) = (wave(p.x, px), wave(p.y, px));
            0.25 + 0.75 * (a * b + (1.0 - a) * (1.0 - b))
        }
        Pattern::Stripes(px) => 0.3 + 0.7 * wave((p.x + p.y) * std::f32::consts::FRAC_1_SQRT_2, px),
    };
    let hue = fractal_noise(p * 0.7 + Vec2::splat(311.0), seed ^ 0x55) - 0.5;
    [0, 1, 2].map(|k| ((0.08 + 0.85 * noise * noise) * shade * tint[k] * (1.0 + 0.5 * hue * (k as f32 - 1.0))).max(0.0))
}

/// Returns the signed distance to a disc, negative inside.
pub fn disc_distance(p: Vec2, centre: Vec2, radius: f32) -> f32 {
    p.distance(centre) - radius
}

/// Returns the signed distance to an ellipse, exact on its axes and near its outline.
pub fn ellipse_distance(p: Vec2, centre: Vec2, radii: Vec2) -> f32 {
    let q = (p - centre) / radii;
    let length = q.length();
    if length < 1e-6 { -radii.min_element() } else { (length - 1.0) * length / (q / radii).length() }
}

/// Returns the signed distance to an axis-parallel box.
pub fn rect_distance(p: Vec2, low: Vec2, high: Vec2) -> f32 {
    let q = (p - (low + high) / 2.0).abs() - (high - low) / 2.0;
    q.max(Vec2::ZERO).length() + q.max_element().min(0.0)
}

/// Returns the signed distance to a line of a given thickness with round ends.
pub fn stroke_distance(p: Vec2, from: Vec2, to: Vec2, thickness: f32) -> f32 {
    let along = ((p - from).dot(to - from) / (to - from).length_squared()).clamp(0.0, 1.0);
    p.distance(from + along * (to - from)) - thickness / 2.0
}

/// Returns the coverage of a pixel by the inside of an outline at a signed distance.
pub fn coverage_from_distance(distance: f32) -> f32 {
    (0.5 - distance).clamp(0.0, 1.0)
}

/// Returns colour times alpha, and alpha.
pub fn premultiply(color: Rgb, alpha: f32) -> Rgba {
    [color[0] * alpha, color[1] * alpha, color[2] * alpha, alpha]
}

/// Small lights at fixed positions.
pub struct Lights {
    lights: Vec<(Vec2, f32, Rgb)>,
}

impl Lights {
    /// Scatters `count` lights in a `size` picture, with radii in pixels and radiances between the given limits.
    pub fn scatter(seed: u64, count: usize, size: Vec2, radius_px: (f32, f32), radiance: (f32, f32)) -> Self {
        let mut rng = Rng::new(seed);
        let mut light = || {
            let at = Vec2::new(rng.between(0.0, size.x), rng.between(0.0, size.y));
            let radius_px = rng.between(radius_px.0, radius_px.1);
            let radiance = rng.between(radiance.0, radiance.1);
            (at, radius_px, [0; 3].map(|_: i32| radiance * rng.between(0.5, 1.0)))
        };
        Self { lights: (0..count).map(|_| light()).collect() }
    }

    /// Returns the colour at a position: a light's, or `behind`.
    pub fn composite_over(&self, p: Vec2, behind: Rgb) -> Rgb {
        self.lights.iter().fold(behind, |below, &(at, radius_px, light)| {
            let alpha = coverage_from_distance(disc_distance(p, at, radius_px));
            if alpha <= 0.0 { below } else { [0, 1, 2].map(|k| below[k] + alpha * (light[k] - below[k])) }
        })
    }
}

/// Samples `of` at the pixels of a picture of `size`, and `margin_px` beyond it on every side.
pub fn render_texture(size: (usize, usize), margin_px: usize, of: impl Fn(Vec2) -> Rgba + Sync) -> Plane<Rgba> {
    let margin = margin_px as f32;
    Plane::from_fn(size.0 + 2 * margin_px, size.1 + 2 * margin_px, |x, y| {
        of(Vec2::new(x as f32 - margin, y as f32 - margin))
    })
}
