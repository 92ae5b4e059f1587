//! The shoulders, in a knitted sweater with a rolled collar. The frame is that of the head.

use std::sync::Arc;

use glam::Vec3;

use super::sdf::{ellipsoid, linear_from_hex, mirror_x, round_cone, smooth_union, smoothstep, torus};
use crate::scene::grid::DistanceGrid;
use crate::scene::noise::fractal_noise;
use crate::scene::part::{Material, Part, ShadingPoint, Surface};
use crate::scene::ray::{BoundingBox, Pose};
use crate::scene::shape::Shape;

pub fn create_part(motion: fn(f32) -> Pose) -> Part {
    let mut part = Part::new_moving(motion);
    let bounds = BoundingBox { low: Vec3::new(-0.33, -0.55, -0.12), high: Vec3::new(0.33, -0.12, 0.19) };
    let guide = Arc::new(DistanceGrid::new(torso_distance, bounds, 0.006));
    part.distance_grid = Some(guide.clone());
    part.add(
        Shape::Field { distance: torso_distance, bounds, guide },
        Material::new(shade_knit, linear_from_hex(0xd99a2b)),
    );
    part.occluders = vec![(Vec3::new(0.0, -0.38, 0.06), 0.16)];
    part
}

/// Returns the signed distance to the sweater: chest, shoulders, arms and collar.
fn torso_distance(p: Vec3) -> f32 {
    let q = mirror_x(p);
    let chest = ellipsoid(p - Vec3::new(0.0, -0.42, 0.045), Vec3::new(0.180, 0.215, 0.112));
    let shoulder = round_cone(q, Vec3::new(0.02, -0.222, 0.062), Vec3::new(0.150, -0.272, 0.068), 0.052, 0.056);
    let arm = round_cone(q, Vec3::new(0.162, -0.284, 0.066), Vec3::new(0.222, -0.56, 0.02), 0.056, 0.050);
    let mut d = smooth_union(chest, shoulder, 0.06);
    d = smooth_union(d, arm, 0.025);
    let c = p - Vec3::new(0.0, 0.0, 0.044);
    // The collar leans back and is rolled twice.
    let lean = c + Vec3::new(0.0, -0.10 * c.z, 0.0);
    d = smooth_union(d, torus(lean + Vec3::new(0.0, 0.186, 0.0), 0.056, 0.019), 0.012);
    d = smooth_union(d, torus(lean + Vec3::new(0.0, 0.158, 0.0), 0.054, 0.016), 0.007);
    d * 0.92
}

/// Returns the relief of the knit at a point, 0 to 1: ribs, each a column of V-shaped loops.
fn stitch_height(p: Vec3) -> f32 {
    let collar = smoothstep(-0.212, -0.204, p.y);
    let around = (p.z - 0.044).atan2(p.x);
    // Columns run around the neck in the collar, and down the body below.
    let column = (p.x / 0.0125) * (1.0 - collar) + (around * 9.5) * collar;
    let across = (column - column.floor()) * 2.0 - 1.0;
    let row = p.y / 0.0085 + 0.55 * across.abs();
    let loop_height = 0.5 + 0.5 * (std::f32::consts::TAU * row).cos();
    let rib = 1.0 - across.abs().powi(3);
    rib * (0.55 + 0.45 * loop_height)
}

/// Wool with the relief of [`stitch_height`], which tilts the normal and darkens the hollows.
fn shade_knit(point: &ShadingPoint) -> Surface {
    let p = point.p;
    let height = stitch_height(p);
    let e = 0.0009;
    let slope = Vec3::new(stitch_height(p + e * Vec3::X) - height, stitch_height(p + e * Vec3::Y) - height, 0.0);
    let normal = (point.normal - 0.35 * (slope - point.normal * slope.dot(point.normal))).normalize_or(point.normal);
    let wool = 0.93 + 0.14 * fractal_noise(90.0 * p, 2);
    Surface {
        wrap: 0.30,
        normal,
        ambient_visibility: 0.55 + 0.45 * height,
        ..Surface::diffuse(point, point.tint * wool * (0.72 + 0.28 * height))
    }
}
