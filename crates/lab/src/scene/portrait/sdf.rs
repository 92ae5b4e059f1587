//! Signed distance functions for modelling, after I. Quilez.

use glam::{Vec2, Vec3};

use bokehcam::color::srgb_to_linear;

/// Returns the union of two forms, blended over `width` metres.
pub fn smooth_union(a: f32, b: f32, width: f32) -> f32 {
    let h = (width - (a - b).abs()).max(0.0) / width;
    a.min(b) - h * h * width * 0.25
}

/// Returns `a` minus `b`, blended over `width` metres.
pub fn smooth_difference(a: f32, b: f32, width: f32) -> f32 {
    -smooth_union(-a, b, width)
}

/// Returns the distance to a ball around the origin.
pub fn sphere(p: Vec3, radius: f32) -> f32 {
    p.length() - radius
}

/// Returns the approximate distance to an ellipsoid around the origin.
pub fn ellipsoid(p: Vec3, radii: Vec3) -> f32 {
    let (k0, k1) = ((p / radii).length(), (p / (radii * radii)).length());
    if k1 > 0.0 { k0 * (k0 - 1.0) / k1 } else { -radii.min_element() }
}

/// Returns the distance to a rod with round ends.
pub fn round_cone(p: Vec3, a: Vec3, b: Vec3, radius_a: f32, radius_b: f32) -> f32 {
    let (pa, ba) = (p - a, b - a);
    let along = (pa.dot(ba) / ba.length_squared()).clamp(0.0, 1.0);
    (pa - along * ba).length() - (radius_a + (radius_b - radius_a) * along)
}

/// Returns the distance to a box around the origin with corners rounded by `radius`.
pub fn rounded_box(p: Vec3, half: Vec3, radius: f32) -> f32 {
    let q = p.abs() - half + radius;
    q.max(Vec3::ZERO).length() + q.max_element().min(0.0) - radius
}

/// Returns the distance to a ring around the `y` axis.
pub fn torus(p: Vec3, radius: f32, thickness: f32) -> f32 {
    Vec2::new(Vec2::new(p.x, p.z).length() - radius, p.y).length() - thickness
}

/// Mirrors the point to positive `x`, for symmetric forms.
pub fn mirror_x(p: Vec3) -> Vec3 {
    Vec3::new(p.x.abs(), p.y, p.z)
}

/// Returns the smoothstep: 0 below `low`, 1 above `high`, smooth between. With `low > high` it falls from 1 to 0.
pub fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Returns the linear colour of an sRGB code such as `0xff8800`.
pub fn linear_from_hex(code: u32) -> Vec3 {
    let channel = |shift: u32| srgb_to_linear(((code >> shift) & 255) as f32 / 255.0);
    Vec3::new(channel(16), channel(8), channel(0))
}
