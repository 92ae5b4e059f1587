//! The shoulders, in a knitted sweater with a rolled collar. The frame is that of the head.

use std::sync::Arc;

use glam::Vec3;

use super::form::{blend, egg, fold, hex, ring, rod, step};
use crate::scene::grid::Grid;
use crate::scene::noise::fractal;
use crate::scene::part::{Material, Part, Spot, Surface};
use crate::scene::ray::{Bounds, Pose};
use crate::scene::shape::Shape;

pub fn part(motion: fn(f32) -> Pose) -> Part {
    let mut part = Part::moving(motion);
    let bounds = Bounds { low: Vec3::new(-0.33, -0.55, -0.12), high: Vec3::new(0.33, -0.12, 0.19) };
    let guide = Arc::new(Grid::new(form, bounds, 0.006));
    part.form = Some(guide.clone());
    part.add(Shape::Field { distance: form, bounds, guide }, Material::new(knit, hex(0xd99a2b)));
    part.shades = vec![(Vec3::new(0.0, -0.38, 0.06), 0.16)];
    part
}

/// Returns the signed distance to the sweater: chest, shoulders, arms and collar.
fn form(p: Vec3) -> f32 {
    let q = fold(p);
    let chest = egg(p - Vec3::new(0.0, -0.42, 0.045), Vec3::new(0.180, 0.215, 0.112));
    let shoulder = rod(q, Vec3::new(0.02, -0.222, 0.062), Vec3::new(0.150, -0.272, 0.068), 0.052, 0.056);
    let arm = rod(q, Vec3::new(0.162, -0.284, 0.066), Vec3::new(0.222, -0.56, 0.02), 0.056, 0.050);
    let mut d = blend(chest, shoulder, 0.06);
    d = blend(d, arm, 0.025);
    let c = p - Vec3::new(0.0, 0.0, 0.044);
    // The collar leans back and is rolled twice.
    let lean = c + Vec3::new(0.0, -0.10 * c.z, 0.0);
    d = blend(d, ring(lean + Vec3::new(0.0, 0.186, 0.0), 0.056, 0.019), 0.012);
    d = blend(d, ring(lean + Vec3::new(0.0, 0.158, 0.0), 0.054, 0.016), 0.007);
    d * 0.92
}

/// Returns the relief of the knit at a point, 0 to 1: ribs, each a column of V-shaped loops.
fn stitch(p: Vec3) -> f32 {
    let collar = step(-0.212, -0.204, p.y);
    let around = (p.z - 0.044).atan2(p.x);
    // Columns run around the neck in the collar, and down the body below.
    let column = (p.x / 0.0125) * (1.0 - collar) + (around * 9.5) * collar;
    let across = (column - column.floor()) * 2.0 - 1.0;
    let row = p.y / 0.0085 + 0.55 * across.abs();
    let loop_height = 0.5 + 0.5 * (std::f32::consts::TAU * row).cos();
    let rib = 1.0 - across.abs().powi(3);
    rib * (0.55 + 0.45 * loop_height)
}

/// Wool with the relief of [`stitch`], which tilts the normal and darkens the hollows.
fn knit(spot: &Spot) -> Surface {
    let p = spot.p;
    let height = stitch(p);
    let e = 0.0009;
    let slope = Vec3::new(stitch(p + e * Vec3::X) - height, stitch(p + e * Vec3::Y) - height, 0.0);
    let normal = (spot.normal - 0.35 * (slope - spot.normal * slope.dot(spot.normal))).normalize_or(spot.normal);
    let wool = 0.93 + 0.14 * fractal(90.0 * p, 2);
    Surface {
        wrap: 0.30,
        normal,
        open: 0.55 + 0.45 * height,
        ..Surface::matt(spot, spot.tint * wool * (0.72 + 0.28 * height))
    }
}
