//! Hair: a combed mass tied into a bun, strands on it, and several hundred fine hairs that stand off.

use std::sync::Arc;

use glam::Vec3;

use super::face::face_distance;
use super::sdf::{
    ellipsoid, linear_from_hex, mirror_x, round_cone, smooth_difference, smooth_union, smoothstep, sphere,
};
use crate::scene::grid::DistanceGrid;
use crate::scene::noise::{Rng, fractal_noise};
use crate::scene::part::{Material, Part, ShadingPoint, Surface};
use crate::scene::ray::BoundingBox;
use crate::scene::shape::Shape;

/// Position of the bun.
const BUN: Vec3 = Vec3::new(0.006, 0.158, 0.045);
const BUN_RADIUS_M: f32 = 0.043;
/// Number of strands that lie on the mass.
const COMBED_STRANDS: usize = 900;
/// Number of fine hairs that stand off the outline.
const FLYAWAY_STRANDS: usize = 330;
/// Mean colour of the hair, as an sRGB code.
const HAIR: u32 = 0x8a4a24;

/// Adds the hair to the head.
pub fn add_hair(part: &mut Part, grid: &Arc<DistanceGrid>) {
    let material = Material::new(shade_combed_hair, linear_from_hex(HAIR));
    let bounds = BoundingBox { low: Vec3::new(-0.125, -0.135, -0.125), high: Vec3::new(0.125, 0.215, 0.145) };
    part.add(Shape::Field { distance: hair_distance, bounds, guide: grid.clone() }, material);
    let mut rng = Rng::new(11);
    for k in 0..COMBED_STRANDS {
        let Some(root) = sample_root(&mut rng) else { continue };
        let points = create_strand(
            &mut rng,
            root,
            StrandStyle { lift_m: 0.0012, rise: 0.0, wild: 0.10, step_m: 0.011 },
            6,
            0.0007,
        );
        part.add_chain(&points, Material::new(shade_hair_strand, linear_from_hex(HAIR)).with_seed(k as u32));
    }
    for k in 0..FLYAWAY_STRANDS {
        let Some(root) = sample_root(&mut rng) else { continue };
        let style = StrandStyle {
            lift_m: 0.001,
            rise: rng.between(0.10, 0.62),
            wild: rng.between(0.25, 0.7),
            step_m: rng.between(0.004, 0.0095),
        };
        let points = create_strand(&mut rng, root, style, 8, 0.00042);
        // No hair may grow into the face.
        if points.iter().skip(2).any(|(p, _)| face_distance(*p) < 0.002) {
            continue;
        }
        part.add_chain(&points, Material::new(shade_hair_strand, linear_from_hex(HAIR)).with_seed(k as u32));
    }
    for side in [-1.0, 1.0] {
        for k in 0..46 {
            add_lock(part, &mut rng, side, k);
        }
    }
}

/// Returns the signed distance to the combed mass with its bun.
pub fn hair_distance(p: Vec3) -> f32 {
    let q = mirror_x(p);
    let cap = ellipsoid(p - Vec3::new(0.0, 0.036, 0.030), Vec3::new(0.0895, 0.100, 0.100));
    // Rounded over the forehead, down to the ears, and open at the neck.
    let window = ellipsoid(p - Vec3::new(0.010, -0.052, -0.105), Vec3::new(0.074, 0.112, 0.098));
    let mut d = smooth_difference(cap, window, 0.012);
    d = smooth_difference(d, sphere(q - Vec3::new(0.0, -0.155, 0.02), 0.105), 0.02);
    // A fringe swept to one side.
    let fringe = round_cone(p, Vec3::new(0.046, 0.094, -0.052), Vec3::new(-0.052, 0.062, -0.058), 0.017, 0.011);
    d = smooth_union(d, fringe, 0.022);
    d = smooth_union(
        d,
        round_cone(p, Vec3::new(-0.052, 0.064, -0.056), Vec3::new(-0.082, 0.012, -0.016), 0.011, 0.006),
        0.014,
    );
    d = smooth_union(
        d,
        round_cone(p, Vec3::new(0.048, 0.090, -0.050), Vec3::new(0.083, 0.014, -0.012), 0.013, 0.006),
        0.016,
    );
    let bun = p - BUN;
    // Wound hair. Here and at the end the scale keeps inexact distances from overestimating.
    let coil = 0.0022 * (3.0 * bun.z.atan2(bun.x) + 150.0 * bun.y).sin();
    d = smooth_union(d, (ellipsoid(bun, Vec3::new(1.08, 0.86, 1.0) * BUN_RADIUS_M) + coil) * 0.8, 0.016);
    d * 0.9
}

/// Returns a coordinate that is constant along the combed hair: the angle around the line through the bun.
fn comb_coordinate(p: Vec3) -> f32 {
    let away = p - Vec3::new(BUN.x, 0.0, BUN.z - 0.03);
    away.z.atan2(away.x)
}

/// The mass, with streaks along the combed or wound hair.
fn shade_combed_hair(point: &ShadingPoint) -> Surface {
    let p = point.p;
    let is_bun = (p - BUN).length() < BUN_RADIUS_M * 1.25;
    // Varies from hair to hair, and is constant along a hair.
    let across = if is_bun {
        let b = p - BUN;
        90.0 * b.y + 5.0 * (b.z.atan2(b.x)).sin() + 40.0 * b.x
    } else {
        34.0 * comb_coordinate(p)
    };
    let streak = fractal_noise(Vec3::new(across, 12.0 * p.y, 3.0), 3);
    let fine = fractal_noise(Vec3::new(4.0 * across, 20.0 * p.y, 9.0), 2);
    let tone = 0.45 + 0.75 * streak + 0.45 * (fine - 0.5);
    let color = point.tint * tone * (0.75 + 0.25 * smoothstep(0.5, 0.75, streak) * Vec3::new(1.6, 1.35, 1.0));
    let normal = (point.normal + 0.5 * (streak - 0.5) * point.normal.cross(Vec3::Y)).normalize_or(point.normal);
    let ambient_visibility = 0.55 + 0.45 * smoothstep(0.25, 0.6, streak);
    Surface { wrap: 0.35, normal, ambient_visibility, ..Surface::diffuse(point, color) }
        .with_highlight(0.12 * tone, 14.0)
}

fn shade_hair_strand(point: &ShadingPoint) -> Surface {
    let tone = 0.75 + 0.7 * crate::scene::noise::hash_to_unit(point.seed ^ 0x77);
    let color = point.tint * tone * Vec3::new(1.25, 1.1, 0.95);
    Surface { wrap: 0.5, fibre: point.tangent, ..Surface::diffuse(point, color) }.with_highlight(0.14, 22.0)
}

/// Returns a random point on the mass, over the head or on the bun, by sphere tracing from outside; `None` where no
/// hair grows.
fn sample_root(rng: &mut Rng) -> Option<Vec3> {
    let from = if rng.next() < 0.22 { BUN } else { Vec3::new(0.0, 0.045, 0.02) };
    let direction = rng.direction();
    let mut p = from + 0.2 * direction;
    for _ in 0..60 {
        let gap_m = hair_distance(p);
        if gap_m < 2e-4 {
            // The nape and the face stay free.
            return (p.y > -0.045).then_some(p);
        }
        p -= gap_m * direction;
        if (p - from).dot(direction) < 0.0 {
            return None;
        }
    }
    None
}

/// The shape of a strand.
struct StrandStyle {
    /// Minimum distance from the mass.
    lift_m: f32,
    /// 0 along the mass, 1 straight up from it.
    rise: f32,
    /// Random deviation per step.
    wild: f32,
    step_m: f32,
}

/// Returns a chain of `steps` cones from `root`: combed towards the bun (or around it), with the lift and deviation of
/// `style`.
fn create_strand(rng: &mut Rng, root: Vec3, style: StrandStyle, steps: usize, radius_m: f32) -> Vec<(Vec3, f32)> {
    let gradient = |p: Vec3| {
        let e = 1e-3;
        let d = |k: Vec3| hair_distance(p + e * k) - hair_distance(p - e * k);
        Vec3::new(d(Vec3::X), d(Vec3::Y), d(Vec3::Z)).normalize_or(Vec3::Y)
    };
    let on_bun = (root - BUN).length() < 1.3 * BUN_RADIUS_M;
    let lean = rng.direction();
    let mut p = root + style.lift_m * gradient(root);
    let mut heading = Vec3::ZERO;
    let mut points = vec![(p, radius_m)];
    for k in 1..=steps {
        let normal = gradient(p);
        let to_bun = if on_bun { Vec3::Y.cross(p - BUN) + 0.5 * (p - BUN).cross(Vec3::X) } else { BUN - p };
        let along = (to_bun - normal * to_bun.dot(normal)).normalize_or(Vec3::X);
        let target =
            along * (1.0 - style.rise) + normal * style.rise + style.wild * (0.7 * lean + 0.6 * rng.direction());
        heading = (0.55 * heading + 0.45 * target.normalize_or(normal)).normalize_or(normal);
        p += style.step_m * heading;
        let sunk_m = style.lift_m - hair_distance(p);
        if sunk_m > 0.0 {
            p += sunk_m * normal;
        }
        points.push((p, radius_m * (1.0 - 0.55 * k as f32 / steps as f32)));
    }
    points
}

/// Adds one hair of the loose lock beside the face, on the left (`side` -1) or right (1): all follow one wavy curve
/// with a small spread.
fn add_lock(part: &mut Part, rng: &mut Rng, side: f32, k: u32) {
    let spread = 0.0045 * Vec3::new(rng.next() - 0.5, 0.0, rng.next() - 0.5) * 2.0;
    let end = 0.6 + 0.4 * rng.next();
    let swing = rng.between(0.8, 1.2);
    let loose = 0.35 * (rng.next() - 0.5);
    let points: Vec<_> = (0..=12)
        .map(|i| {
            let s = end * i as f32 / 12.0;
            let wave = 0.007 * swing * (7.5 * s + loose).sin();
            let p = Vec3::new(
                side * (0.0765 + 0.017 * (3.1 * s).sin() - 0.010 * s + wave),
                0.062 - 0.172 * s,
                -0.036 - 0.012 * (2.6 * s).sin() + 0.010 * s + 0.4 * wave,
            );
            (p + spread * (0.5 + 1.4 * s * (1.0 - 0.5 * s)), 0.0009 * (1.0 - 0.5 * s))
        })
        .collect();
    part.add_chain(&points, Material::new(shade_hair_strand, linear_from_hex(HAIR)).with_seed(900 + k));
}
