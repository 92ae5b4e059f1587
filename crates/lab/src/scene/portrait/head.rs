//! The head: face, eyes, brows, glasses and hair.

use std::sync::Arc;

use glam::{Mat3, Vec3};

use super::face::{EYE, EYE_RADIUS_M, face_distance, front_z, shade_skin};
use super::hair;
use super::sdf::{linear_from_hex, smoothstep};
use crate::scene::grid::DistanceGrid;
use crate::scene::noise::fractal_noise;
use crate::scene::part::{Material, Part, ShadingPoint, Surface};
use crate::scene::ray::{BoundingBox, Pose};
use crate::scene::shape::Shape;

/// Creates the head with its hair.
pub fn create_part(motion: fn(f32) -> Pose) -> Part {
    let mut part = Part::new_moving(motion);
    let around = BoundingBox { low: Vec3::new(-0.13, -0.24, -0.13), high: Vec3::new(0.13, 0.22, 0.15) };
    let grid = Arc::new(DistanceGrid::new(|p| face_distance(p).min(hair::hair_distance(p)), around, 0.004));
    let bounds = BoundingBox { low: Vec3::new(-0.1, -0.24, -0.13), high: Vec3::new(0.1, 0.14, 0.13) };
    part.add(
        Shape::Field { distance: face_distance, bounds, guide: grid.clone() },
        Material::new(shade_skin, linear_from_hex(0xe3ab8c)),
    );
    for side in [-1.0, 1.0] {
        let mirror = Vec3::new(side, 1.0, 1.0);
        let eye = Shape::Sphere { centre: EYE * mirror, radius: EYE_RADIUS_M };
        part.add(eye, Material::new(shade_eyeball, linear_from_hex(0x4f6b45)).with_seed((side > 0.0).into()));
        add_lashes_and_brow(&mut part, mirror);
        add_glasses(&mut part, mirror);
    }
    let bridge = [-0.0095, -0.004, 0.004, 0.0095].map(|x| (Vec3::new(x, 0.0095 - 30.0 * x * x, -0.0985), 0.0013));
    part.add_chain(&bridge, Material::new(shade_satin, linear_from_hex(0x3a2416)));
    hair::add_hair(&mut part, &grid);
    part.distance_grid = Some(grid);
    part.occluders = vec![(Vec3::new(0.0, 0.02, 0.02), 0.1), (Vec3::new(0.0, -0.05, 0.0), 0.075)];
    part
}

/// Adds upper lashes along the edge of the lid, and the brow on the skin above. `mirror` selects the side.
fn add_lashes_and_brow(part: &mut Part, mirror: Vec3) {
    let dark = Material::new(shade_satin, linear_from_hex(0x2a1710));
    let lash: Vec<_> = (0..9)
        .map(|i| {
            let x = -0.0118 + 0.0262 * i as f32 / 8.0;
            let lift = 0.0078 - 0.16 * x.abs();
            let radius = EYE_RADIUS_M + 0.0014;
            let z = -(radius * radius - x * x - lift * lift).max(1e-6).sqrt();
            let outer = smoothstep(0.008, 0.0144, x);
            let p = EYE + Vec3::new(x, lift + 0.0010 * outer, z);
            (p * mirror, 0.0007 + 0.0005 * (1.0 - outer))
        })
        .collect();
    part.add_chain(&lash, dark);
    let brow: Vec<_> = (0..8)
        .map(|i| {
            let s = i as f32 / 7.0;
            let x = 0.0135 + 0.039 * s;
            let y = 0.0365 + 0.0058 * (1.0 - (1.6 * s - 0.75).powi(2));
            (Vec3::new(x, y, front_z(x, y) + 0.0008) * mirror, 0.0027 - 0.0019 * s * s)
        })
        .collect();
    part.add_chain(&brow, Material::new(shade_satin, linear_from_hex(0x5d3218)));
}

fn add_glasses(part: &mut Part, mirror: Vec3) {
    let tortoise = Material::new(shade_satin, linear_from_hex(0x3a2416));
    let rim: Vec<_> = (0..=40)
        .map(|i| {
            let (sin, cos) = (i as f32 / 40.0 * std::f32::consts::TAU).sin_cos();
            let p = Vec3::new(0.0325 + 0.0235 * cos, 0.0020 + 0.0215 * sin, -0.0945 + 0.010 * cos.max(0.0).powi(2));
            (p * mirror, 0.00135)
        })
        .collect();
    part.add_chain(&rim, tortoise);
    let temple = [Vec3::new(0.056, 0.006, -0.0835), Vec3::new(0.0775, 0.012, -0.060), Vec3::new(0.083, 0.014, 0.02)];
    part.add_chain(&temple.map(|p| (p * mirror, 0.0013)), tortoise);
}

/// An eye that looks at the camera: white, iris with its dark rim, pupil, and the reflection of a lamp. The seed
/// selects the side.
fn shade_eyeball(point: &ShadingPoint) -> Surface {
    let side = if point.seed == 1 { 1.0 } else { -1.0 };
    let gaze = Mat3::from_rotation_y(-0.17) * Vec3::NEG_Z;
    let local = (point.p - EYE * Vec3::new(side, 1.0, 1.0)) / EYE_RADIUS_M;
    // Distance from the axis of the gaze, in radii of the eye.
    let off = (local - gaze * local.dot(gaze)).length();
    let streak = fractal_noise(Vec3::new(local.y.atan2(local.x) * 9.0, off * 3.0, 4.0), 2);
    let iris_alpha = smoothstep(0.53, 0.46, off);
    let color = (point.tint * (0.5 + 1.1 * streak)).lerp(linear_from_hex(0x7a5a2e), smoothstep(0.40, 0.22, off));
    let color = color
        .lerp(linear_from_hex(0x10100c), smoothstep(0.40, 0.52, off))
        .lerp(Vec3::splat(0.006), smoothstep(0.235, 0.205, off));
    let white = linear_from_hex(0xf0e9e2) * (1.0 - 0.25 * smoothstep(0.2, 0.9, local.x.abs()));
    let catchlight = smoothstep(0.13, 0.07, (local - Vec3::new(-0.25, 0.28, -0.93)).length());
    let surface = Surface { wrap: 0.2, ..Surface::diffuse(point, white.lerp(color, iris_alpha)) };
    Surface { emission: Vec3::splat(0.9 * catchlight), ..surface }.with_highlight(0.5, 300.0)
}

/// One colour with a soft highlight.
fn shade_satin(point: &ShadingPoint) -> Surface {
    Surface::diffuse(point, point.tint).with_highlight(0.25, 60.0)
}
