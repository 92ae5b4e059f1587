//! The form of the face, and its skin. In the head's frame the origin is the middle of the head, and the face looks
//! towards negative `z`.

use glam::Vec3;

use super::sdf::{
    ellipsoid, linear_from_hex, mirror_x, round_cone, smooth_difference, smooth_union, smoothstep, sphere,
};
use crate::scene::noise::fractal_noise;
use crate::scene::part::{ShadingPoint, Surface};

/// Position of the right eye (in the picture) in the head's frame.
pub const EYE: Vec3 = Vec3::new(0.0315, 0.004, -0.0625);
/// Radius of an eye.
pub const EYE_RADIUS_M: f32 = 0.0168;

/// Returns the signed distance to the bare head and neck with open eyes: skull and jaw, then feature by feature.
pub fn face_distance(p: Vec3) -> f32 {
    let q = mirror_x(p);
    let skull = ellipsoid(p - Vec3::new(0.0, 0.028, 0.018), Vec3::new(0.078, 0.094, 0.094));
    let jaw = ellipsoid(p - Vec3::new(0.0, -0.032, -0.014), Vec3::new(0.0705, 0.080, 0.069));
    let mut d = smooth_union(skull, jaw, 0.03);
    // Chin and cheeks.
    d = smooth_union(d, sphere(p - Vec3::new(0.0, -0.088, -0.047), 0.022), 0.045);
    d = smooth_union(d, sphere(q - Vec3::new(0.040, -0.036, -0.040), 0.032), 0.034);
    // Eye sockets, bridge and wings of the nose.
    d = smooth_difference(d, sphere(q - Vec3::new(0.0315, 0.004, -0.098), 0.021), 0.018);
    d = smooth_union(
        d,
        round_cone(p, Vec3::new(0.0, 0.012, -0.077), Vec3::new(0.0, -0.024, -0.0955), 0.006, 0.0105),
        0.016,
    );
    d = smooth_union(d, sphere(q - Vec3::new(0.0095, -0.028, -0.0870), 0.0068), 0.008);
    // The mouth: two lips in a smile, rounded in the middle.
    let m = Vec3::new((p.x * p.x + 2e-5).sqrt(), p.y, p.z);
    d = smooth_union(
        d,
        round_cone(m, Vec3::new(0.0, -0.0545, -0.0855), Vec3::new(0.0245, -0.0485, -0.0725), 0.0040, 0.0022),
        0.006,
    );
    d = smooth_union(
        d,
        round_cone(m, Vec3::new(0.0, -0.0625, -0.0835), Vec3::new(0.0200, -0.0550, -0.0745), 0.0050, 0.0025),
        0.006,
    );
    d = smooth_difference(d, sphere(q - Vec3::new(0.0290, -0.0470, -0.0715), 0.0015), 0.006);
    let ear = ellipsoid(q - Vec3::new(0.080, -0.004, 0.022), Vec3::new(0.011, 0.029, 0.018));
    d = smooth_union(d, smooth_difference(ear, sphere(q - Vec3::new(0.092, -0.002, 0.014), 0.010), 0.006), 0.008);
    d = smooth_union(d, eyelid_distance(q), 0.004);
    smooth_union(d, round_cone(p, Vec3::new(0.0, -0.08, 0.03), Vec3::new(0.0, -0.23, 0.045), 0.044, 0.050), 0.03)
}

/// Returns the distance to upper and lower eyelid: the parts of a slightly larger ball above and below the opening.
fn eyelid_distance(q: Vec3) -> f32 {
    let p = q - EYE;
    let shell = sphere(p, EYE_RADIUS_M + 0.0013);
    let above = -(p.y - 0.0074 + 0.16 * p.x.abs() + 0.12 * (p.z + EYE_RADIUS_M));
    let below = p.y + 0.0078 - 0.10 * p.x.abs();
    shell.max(above.min(below))
}

/// Returns the depth of the front of the face at (`x`, `y`), by sphere tracing along `z`.
pub fn front_z(x: f32, y: f32) -> f32 {
    let mut z = -0.13;
    for _ in 0..40 {
        z += face_distance(Vec3::new(x, y, z));
    }
    z
}

/// Skin with flushed cheeks, nose and ears, and red lips.
pub fn shade_skin(point: &ShadingPoint) -> Surface {
    let (p, q) = (point.p, mirror_x(point.p));
    let near = |centre: Vec3, radius_m: f32| (-(q - centre).length_squared() / (radius_m * radius_m)).exp();
    let mut color = point.tint * (0.96 + 0.08 * fractal_noise(180.0 * p, 2));
    let flush = 0.75 * near(Vec3::new(0.042, -0.030, -0.066), 0.021)
        + 0.40 * near(Vec3::new(0.0, -0.024, -0.105), 0.015)
        + 0.40 * near(Vec3::new(0.085, 0.0, 0.02), 0.025);
    color = color.lerp(linear_from_hex(0xd9705c), 0.55 * flush.min(1.0));
    // The curved line between the lips, and the width of the lips, which narrows towards the corners.
    let middle = -0.0588 + 12.0 * p.x * p.x;
    let width = (1.0 - (p.x / 0.0285).powi(2)).max(0.0).sqrt();
    let (over, under) = (p.y - middle, middle - p.y);
    let lip = smoothstep(0.0, 0.0016, 0.0068 * width - over) * smoothstep(0.0, 0.0016, 0.0092 * width - under);
    // Only at the front: the back of the head has the same x and y.
    if p.z < -0.05 && lip > 0.0 {
        let seam = 0.6 * (-(over / 0.0010).powi(2)).exp();
        color = color.lerp(linear_from_hex(0xb8453f), 0.8 * lip).lerp(linear_from_hex(0x4a1512), seam * lip);
    }
    let gloss = 0.05 + 0.10 * lip * f32::from(p.z < -0.05);
    Surface { wrap: 0.35, ..Surface::diffuse(point, color) }.with_highlight(gloss, 22.0)
}
