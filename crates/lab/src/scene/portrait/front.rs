//! Objects in front of the subject: the table with a cup and a notebook, and a twig near the lens.

use std::f32::consts::TAU;
use std::sync::Arc;

use glam::{Mat3, Vec2, Vec3};

use super::materials;
use super::sdf::{linear_from_hex, smooth_difference, smooth_union, smoothstep};
use crate::scene::grid::DistanceGrid;
use crate::scene::noise::{Rng, hash_to_unit};
use crate::scene::part::{Material, Part, ShadingPoint, Surface};
use crate::scene::ray::{BoundingBox, Pose};
use crate::scene::shape::Shape;

/// Height of the table top.
const TABLE_Y: f32 = -0.232;
const CUP: Vec3 = Vec3::new(0.300, TABLE_Y, 0.93);

/// Creates the table with the objects on it.
pub fn create_desk() -> Part {
    let mut part = Part::new_static();
    let top = Shape::Cuboid {
        centre: Vec3::new(0.0, TABLE_Y - 0.02, 0.72),
        axes: Mat3::IDENTITY,
        half: Vec3::new(1.3, 0.02, 0.33),
    };
    part.add(top, Material::new(materials::shade_boards, linear_from_hex(0xc79a68)));
    let bounds = BoundingBox { low: CUP - Vec3::new(0.05, 0.002, 0.05), high: CUP + Vec3::new(0.09, 0.1, 0.05) };
    let around = BoundingBox { low: Vec3::new(-0.5, TABLE_Y - 0.02, 0.75), high: Vec3::new(0.5, -0.10, 1.06) };
    let grid = Arc::new(DistanceGrid::new(|p| (p.y - TABLE_Y).min(cup_distance(p)), around, 0.008));
    let guide = Arc::new(DistanceGrid::new(cup_distance, bounds, 0.008));
    part.add(
        Shape::Field { distance: cup_distance, bounds, guide },
        Material::new(shade_glaze, linear_from_hex(0xe9e2d3)),
    );
    let turn = Mat3::from_rotation_y(0.35);
    let book = Shape::Cuboid {
        centre: Vec3::new(-0.335, TABLE_Y + 0.008, 0.90),
        axes: turn,
        half: Vec3::new(0.085, 0.008, 0.06),
    };
    part.add(book, Material::new(materials::shade_diffuse, linear_from_hex(0x7c2f33)));
    part.distance_grid = Some(grid);
    part.occluders = vec![(CUP + 0.04 * Vec3::Y, 0.045)];
    part
}

/// Returns the signed distance to the cup: a hollow body with a handle, and coffee in it.
fn cup_distance(p: Vec3) -> f32 {
    let q = p - CUP;
    let radial = Vec2::new(q.x, q.z).length();
    let radius = 0.036 + 0.05 * (q.y - 0.04);
    let side = (radial - radius) * 0.98;
    let body = side.max((q.y - 0.046).abs() - 0.044);
    let hollow = (side + 0.004).max(0.006 - q.y);
    let handle = Vec2::new(Vec2::new(q.x - 0.038, q.y - 0.046).length() - 0.021, q.z).length() - 0.0048;
    let shell = smooth_difference(smooth_union(body, handle, 0.006), hollow, 0.0025);
    let coffee = (side + 0.002).max((q.y - 0.066).abs() - 0.003);
    // Blends are no exact distances: scale them so that they do not overestimate.
    shell.min(coffee) * 0.9
}

/// The cup's glaze in two colours, and the coffee inside.
fn shade_glaze(point: &ShadingPoint) -> Surface {
    let q = point.p - CUP;
    let is_inside = Vec2::new(q.x, q.z).length() < 0.0335 + 0.05 * (q.y - 0.04);
    if is_inside && q.y < 0.0695 {
        return Surface::diffuse(point, linear_from_hex(0x3a2012)).with_highlight(0.3, 60.0);
    }
    // The lower part has another colour, up to a wavy line.
    let dip = smoothstep(0.034, 0.036, q.y + 0.003 * (6.0 * q.z.atan2(q.x)).sin());
    let color = linear_from_hex(0x2f6f73).lerp(point.tint, dip);
    Surface::diffuse(point, color).with_highlight(0.30, 50.0)
}

/// Creates a twig with round leaves that leans into the picture from the lower left.
pub fn create_twig() -> Part {
    let mut part = Part::new_moving(|phase| {
        let sway = Mat3::from_rotation_z(0.020 * (TAU * phase + 1.2).sin())
            * Mat3::from_rotation_y(0.05 * (TAU * phase).cos());
        Pose::rotation_about(Vec3::new(-0.30, -0.30, 0.52), sway)
    });
    let mut rng = Rng::new(23);
    let arms = [
        [
            Vec3::new(-0.27, -0.26, 0.53),
            Vec3::new(-0.21, -0.12, 0.50),
            Vec3::new(-0.160, -0.045, 0.49),
            Vec3::new(-0.098, -0.012, 0.50),
        ],
        [
            Vec3::new(-0.25, -0.24, 0.56),
            Vec3::new(-0.20, -0.14, 0.55),
            Vec3::new(-0.140, -0.105, 0.54),
            Vec3::new(-0.085, -0.098, 0.53),
        ],
        [
            Vec3::new(-0.31, -0.22, 0.50),
            Vec3::new(-0.27, -0.06, 0.48),
            Vec3::new(-0.245, 0.03, 0.47),
            Vec3::new(-0.215, 0.085, 0.47),
        ],
    ];
    for arm in arms {
        add_arm(&mut part, &mut rng, arm);
    }
    part
}

/// Adds a stem along a cubic Bézier curve with leaves in pairs.
fn add_arm(part: &mut Part, rng: &mut Rng, [a, b, c, d]: [Vec3; 4]) {
    let at = |s: f32| {
        let r = 1.0 - s;
        a * (r * r * r) + b * (3.0 * r * r * s) + c * (3.0 * r * s * s) + d * (s * s * s)
    };
    let stem: Vec<_> = (0..=16).map(|i| i as f32 / 16.0).map(|s| (at(s), 0.0024 * (1.0 - 0.7 * s))).collect();
    part.add_chain(&stem, Material::new(materials::shade_diffuse, linear_from_hex(0x6a5238)));
    for k in 0..7 {
        let s = 0.22 + 0.13 * k as f32;
        let ahead = (at(s + 0.02) - at(s - 0.02)).normalize_or(Vec3::X);
        // The last leaf is at the tip.
        let sides: &[f32] = if k == 6 { &[0.0] } else { &[-1.0, 1.0] };
        for side in sides {
            let out = (ahead.cross(Vec3::Z) * *side + ahead * 0.55 + 0.30 * rng.direction()).normalize_or(ahead);
            let out = if *side == 0.0 { ahead } else { out };
            let length = 0.024 * (1.15 - 0.5 * s) * rng.between(0.85, 1.15);
            add_leaf(part, rng, at(s.min(1.0)), out, length);
        }
    }
}

/// Adds a leaf as two halves folded along its midrib.
fn add_leaf(part: &mut Part, rng: &mut Rng, root: Vec3, out: Vec3, half_length: f32) {
    let facing = (Vec3::new(-0.35, 0.45, -1.0) + 0.65 * rng.direction()).normalize_or(Vec3::NEG_Z);
    let across = out.cross(facing).normalize_or(Vec3::X);
    let normal = across.cross(out);
    let green = linear_from_hex(0x4f8a4c).lerp(linear_from_hex(0x86a94e), rng.next());
    let seed = (rng.next() * 1e6) as u32;
    let centre = root + (half_length + 0.004) * out;
    part.add_chain(
        &[(root, 0.0009), (centre, 0.0005)],
        Material::new(materials::shade_diffuse, linear_from_hex(0x73854a)),
    );
    for side in [-1.0f32, 1.0] {
        let wing = (across * side + 0.28 * normal * -1.0).normalize_or(across)
            * (0.62 + 0.1 * hash_to_unit(seed))
            * half_length;
        let shape = Shape::Quad { centre, right: half_length * out, up: wing, cut: is_in_half_leaf };
        part.add(shape, Material::new(materials::shade_leaf, green).with_seed(seed));
    }
}

/// The outline of one half of a leaf: `u` from stalk to tip, `v` outwards from the midrib.
pub fn is_in_half_leaf(uv: Vec2) -> bool {
    let round = (1.0 - uv.x * uv.x).max(0.0);
    uv.y >= 0.0 && uv.y <= round.powf(0.62) * (1.0 - 0.22 * uv.x)
}
