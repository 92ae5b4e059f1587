//! The sofa, the low table in front of it, and the objects on the table.

use std::sync::Arc;

use glam::{Mat3, Vec3};

use super::materials;
use super::room::{FLOOR_Y, add_box, create_material};
use super::sdf::{linear_from_hex, rounded_box, smooth_union};
use crate::scene::grid::DistanceGrid;
use crate::scene::noise::Rng;
use crate::scene::part::{Material, Part};
use crate::scene::ray::BoundingBox;
use crate::scene::shape::Shape;

const SOFA: Vec3 = Vec3::new(-0.98, -0.40, 2.35);
/// Centre of the table top.
pub const TABLE: Vec3 = Vec3::new(1.10, -0.50, 2.45);

/// Adds a sofa with a pillow, and the low table in front of it.
pub fn add_seats(part: &mut Part, grid: &Arc<DistanceGrid>) {
    let bounds = BoundingBox { low: SOFA - Vec3::new(0.75, 0.65, 0.45), high: SOFA + Vec3::new(0.75, 0.25, 0.5) };
    part.add(
        Shape::Field { distance: sofa_distance, bounds, guide: grid.clone() },
        create_material(materials::shade_cloth, 0x8c4a52),
    );
    let cushion = BoundingBox { low: SOFA - Vec3::new(0.55, 0.2, 0.4), high: SOFA + Vec3::new(0.1, 0.25, 0.1) };
    part.add(
        Shape::Field { distance: pillow_distance, bounds: cushion, guide: grid.clone() },
        create_material(materials::shade_stripes, 0x35606b),
    );
    add_box(
        part,
        [TABLE.x - 0.62, TABLE.y - 0.03, TABLE.z - 0.55],
        [TABLE.x + 0.75, TABLE.y, TABLE.z + 0.55],
        create_material(materials::shade_cloth, 0xcfc2a8),
    );
    for (x, z) in [(-0.55, -0.48), (-0.55, 0.48), (0.6, 0.48)] {
        let leg = TABLE + Vec3::new(x, -0.03, z);
        part.add_chain(
            &[(leg, 0.022), (Vec3::new(leg.x, FLOOR_Y, leg.z), 0.016)],
            create_material(materials::shade_diffuse, 0x4a2f1c),
        );
    }
    add_still_life(part);
}

/// Adds the objects on the low table: candles in glasses, a vase with twigs, a bowl of oranges.
fn add_still_life(part: &mut Part) {
    for (x, z, height) in [(-0.36, -0.22, 0.07), (-0.22, -0.36, 0.05)] {
        let foot = TABLE + Vec3::new(x, 0.0, z);
        let glass = Shape::Frustum { base: foot, height, low_radius: 0.030, high_radius: 0.034 };
        part.add(glass, Material::new(materials::shade_lamp_shade, Vec3::new(0.9, 0.34, 0.10)));
        let flame = foot + (height + 0.006) * Vec3::Y;
        part.add(
            Shape::ellipsoid(flame, Mat3::IDENTITY, Vec3::new(0.0075, 0.017, 0.0075)),
            Material::new(materials::shade_emissive, 11.0 * Vec3::new(1.0, 0.60, 0.22)),
        );
    }
    let foot = TABLE + Vec3::new(0.10, 0.0, 0.05);
    part.add(
        Shape::ellipsoid(foot + 0.085 * Vec3::Y, Mat3::IDENTITY, Vec3::new(0.062, 0.09, 0.062)),
        create_material(materials::shade_ceramic, 0xd9cdb8),
    );
    let mut rng = Rng::new(77);
    for _ in 0..7 {
        let lean = 0.45 * rng.direction() * Vec3::new(1.0, 0.0, 1.0);
        let from = foot + 0.16 * Vec3::Y;
        let stem: Vec<_> = (0..=6)
            .map(|i| i as f32 / 6.0)
            .map(|s| (from + 0.34 * s * (Vec3::Y + lean * s), 0.0032 - 0.0015 * s))
            .collect();
        part.add_chain(&stem, create_material(materials::shade_diffuse, 0x5c4a2c));
        for (on, _) in &stem[2..] {
            let bud = *on + 0.018 * rng.direction();
            let color = linear_from_hex(0xe9c3b0).lerp(linear_from_hex(0xd98a86), rng.next());
            part.add(
                Shape::Sphere { centre: bud, radius: rng.between(0.010, 0.019) },
                Material::new(materials::shade_cloth, color),
            );
        }
    }
    for (x, y, z) in [(0.34, 0.035, -0.2), (0.405, 0.035, -0.165), (0.345, 0.035, -0.13), (0.365, 0.088, -0.165)] {
        let orange = Shape::Sphere { centre: TABLE + Vec3::new(x, y, z), radius: 0.037 };
        part.add(orange, create_material(materials::shade_ceramic, 0xdd8026));
    }
}

/// Returns the signed distance to the sofa: back, seat and two arms.
pub fn sofa_distance(p: Vec3) -> f32 {
    let q = p - SOFA;
    let back = rounded_box(q - Vec3::new(0.0, -0.12, 0.26), Vec3::new(0.62, 0.26, 0.10), 0.09);
    let seat = rounded_box(q - Vec3::new(0.0, -0.36, -0.02), Vec3::new(0.60, 0.10, 0.32), 0.06);
    let side = Vec3::new(q.x.abs() - 0.62, q.y + 0.26, q.z - 0.02);
    smooth_union(back, seat, 0.03).min(rounded_box(side, Vec3::new(0.085, 0.21, 0.33), 0.08))
}

/// Returns the signed distance to a rotated pillow, thinner towards its edges (scaled, as it is not an exact distance).
pub fn pillow_distance(p: Vec3) -> f32 {
    let q = Mat3::from_rotation_x(0.35) * Mat3::from_rotation_z(-0.2) * (p - SOFA - Vec3::new(-0.16, -0.07, 0.04));
    let edge = (q.x / 0.19).powi(2).max((q.y / 0.19).powi(2)).min(1.0);
    rounded_box(q, Vec3::new(0.19, 0.19, 0.075 - 0.045 * edge), 0.03) * 0.8
}
