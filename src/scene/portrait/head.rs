//! The head: face, eyes, brows and glasses. Its frame has the middle of the head at the origin and the face towards
//! negative `z`.

use glam::{Mat3, Vec3};

use super::form::{ball, blend, carve, egg, fold, hex, rod, step};
use super::hair;
use crate::scene::noise::fractal;
use crate::scene::part::{Material, Part, Spot, Surface};
use crate::scene::ray::{Bounds, Pose};
use crate::scene::shape::Shape;

/// Right eye (of the picture) in the head's frame.
const EYE: Vec3 = Vec3::new(0.0315, 0.004, -0.0625);
const EYE_RADIUS_M: f32 = 0.0155;

/// The head with its hair.
pub fn part(motion: fn(f32) -> Pose) -> Part {
    let mut part = Part::moving(motion);
    let bounds = Bounds { low: Vec3::new(-0.1, -0.24, -0.13), high: Vec3::new(0.1, 0.14, 0.13) };
    part.add(Shape::Field { distance: face, bounds }, Material::new(skin, hex(0xe3ab8c)));
    for side in [-1.0, 1.0] {
        let mirror = Vec3::new(side, 1.0, 1.0);
        let eye = Shape::Sphere { centre: EYE * mirror, radius: EYE_RADIUS_M };
        part.add(eye, Material::new(iris, hex(0x4f6b45)).seeded((side > 0.0).into()));
        add_eye_lines(&mut part, mirror);
        add_glasses(&mut part, mirror);
    }
    let bridge = [-0.0095, -0.004, 0.004, 0.0095].map(|x| (Vec3::new(x, 0.0095 - 30.0 * x * x, -0.0985), 0.0013));
    part.add_chain(&bridge, Material::new(frame, hex(0x3a2416)));
    hair::grow(&mut part);
    part.form = Some(|p| face(p).min(hair::mass(p)));
    part.shades = vec![(Vec3::new(0.0, 0.02, 0.02), 0.1), (Vec3::new(0.0, -0.05, 0.0), 0.075)];
    part
}

/// Skin without hair, eyes open.
pub fn face(p: Vec3) -> f32 {
    let q = fold(p);
    let skull = egg(p - Vec3::new(0.0, 0.028, 0.018), Vec3::new(0.078, 0.094, 0.094));
    let jaw = egg(p - Vec3::new(0.0, -0.032, -0.014), Vec3::new(0.0665, 0.083, 0.069));
    let mut d = blend(skull, jaw, 0.03);
    d = blend(d, ball(p - Vec3::new(0.0, -0.094, -0.050), 0.020), 0.035);
    d = blend(d, ball(q - Vec3::new(0.037, -0.036, -0.045), 0.030), 0.028);
    d = carve(d, ball(q - Vec3::new(0.0315, 0.004, -0.098), 0.021), 0.018);
    d = blend(d, rod(p, Vec3::new(0.0, 0.012, -0.077), Vec3::new(0.0, -0.024, -0.0955), 0.006, 0.0105), 0.016);
    d = blend(d, ball(q - Vec3::new(0.0095, -0.028, -0.0870), 0.0068), 0.008);
    // The mouth: two lips that meet in a smile.
    d = blend(d, rod(q, Vec3::new(0.0, -0.0545, -0.0855), Vec3::new(0.021, -0.0520, -0.0735), 0.0042, 0.0022), 0.006);
    d = blend(d, rod(q, Vec3::new(0.0, -0.0625, -0.0835), Vec3::new(0.017, -0.0575, -0.0745), 0.0052, 0.0025), 0.006);
    d = carve(d, ball(q - Vec3::new(0.0255, -0.0515, -0.0725), 0.0015), 0.006);
    let ear = egg(q - Vec3::new(0.080, -0.004, 0.022), Vec3::new(0.011, 0.029, 0.018));
    d = blend(d, carve(ear, ball(q - Vec3::new(0.092, -0.002, 0.014), 0.010), 0.006), 0.008);
    d = blend(d, lid(q), 0.004);
    blend(d, rod(p, Vec3::new(0.0, -0.08, 0.03), Vec3::new(0.0, -0.23, 0.045), 0.044, 0.050), 0.03)
}

/// Upper and lower eyelid: what a slightly larger ball shows above and below the opening.
fn lid(q: Vec3) -> f32 {
    let p = q - EYE;
    let shell = ball(p, EYE_RADIUS_M + 0.0013);
    let above = -(p.y - 0.0058 + 0.16 * p.x.abs() + 0.12 * (p.z + EYE_RADIUS_M));
    let below = p.y + 0.0078 - 0.10 * p.x.abs();
    shell.max(above.min(below))
}

fn add_eye_lines(part: &mut Part, mirror: Vec3) {
    let dark = Material::new(frame, hex(0x2a1710));
    let lash: Vec<_> = (0..9)
        .map(|i| {
            let x = -0.0118 + 0.0262 * i as f32 / 8.0;
            let lift = 0.0062 - 0.16 * x.abs();
            let radius = EYE_RADIUS_M + 0.0014;
            let z = -(radius * radius - x * x - lift * lift).max(1e-6).sqrt();
            let outer = step(0.008, 0.0144, x);
            let p = EYE + Vec3::new(x, lift + 0.0010 * outer, z);
            (p * mirror, 0.0007 + 0.0005 * (1.0 - outer))
        })
        .collect();
    part.add_chain(&lash, dark);
    let brow: Vec<_> = (0..8)
        .map(|i| {
            let s = i as f32 / 7.0;
            let x = 0.0135 + 0.039 * s;
            let y = 0.0335 + 0.0068 * (1.0 - (1.55 * s - 0.95).powi(2));
            (Vec3::new(x, y, surface_z(x, y) + 0.0008) * mirror, 0.0027 - 0.0019 * s * s)
        })
        .collect();
    part.add_chain(&brow, Material::new(frame, hex(0x5d3218)));
}

fn add_glasses(part: &mut Part, mirror: Vec3) {
    let tortoise = Material::new(frame, hex(0x3a2416));
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

/// Depth of the front of the face at (`x`, `y`).
fn surface_z(x: f32, y: f32) -> f32 {
    let mut z = -0.13;
    for _ in 0..40 {
        z += face(Vec3::new(x, y, z));
    }
    z
}

fn skin(spot: &Spot) -> Surface {
    let (p, q) = (spot.p, fold(spot.p));
    let near = |centre: Vec3, reach_m: f32| (-(q - centre).length_squared() / (reach_m * reach_m)).exp();
    let mut color = spot.tint * (0.96 + 0.08 * fractal(180.0 * p, 2));
    let flush = 0.75 * near(Vec3::new(0.042, -0.030, -0.066), 0.021)
        + 0.40 * near(Vec3::new(0.0, -0.024, -0.105), 0.015)
        + 0.40 * near(Vec3::new(0.085, 0.0, 0.02), 0.025);
    color = color.lerp(hex(0xd9705c), 0.55 * flush.min(1.0));
    let middle = -0.0585 + 7.0 * p.x * p.x;
    let width = (1.0 - (p.x / 0.0245).powi(2)).max(0.0).sqrt();
    let (over, under) = (p.y - middle, middle - p.y);
    let lip = step(0.0, 0.0016, 0.0068 * width - over) * step(0.0, 0.0016, 0.0092 * width - under);
    if p.z < -0.05 && lip > 0.0 {
        let seam = 0.6 * (-(over / 0.0010).powi(2)).exp();
        color = color.lerp(hex(0xb8453f), 0.8 * lip).lerp(hex(0x4a1512), seam * lip);
    }
    let gloss = 0.05 + 0.10 * lip * f32::from(p.z < -0.05);
    Surface { wrap: 0.35, ..Surface::matt(spot, color) }.glossy(gloss, 22.0)
}

fn iris(spot: &Spot) -> Surface {
    let side = if spot.seed == 1 { 1.0 } else { -1.0 };
    let gaze = Mat3::from_rotation_y(0.10) * Vec3::NEG_Z;
    let local = (spot.p - EYE * Vec3::new(side, 1.0, 1.0)) / EYE_RADIUS_M;
    let off = (local - gaze * local.dot(gaze)).length();
    let streak = fractal(Vec3::new(local.y.atan2(local.x) * 9.0, off * 3.0, 4.0), 2);
    let rim = step(0.53, 0.46, off);
    let color = (spot.tint * (0.5 + 1.1 * streak)).lerp(hex(0x7a5a2e), step(0.40, 0.22, off));
    let color = color.lerp(hex(0x10100c), step(0.40, 0.52, off)).lerp(Vec3::splat(0.006), step(0.235, 0.205, off));
    let white = hex(0xf0e9e2) * (1.0 - 0.25 * step(0.2, 0.9, local.x.abs()));
    let catch = step(0.13, 0.07, (local - Vec3::new(-0.25, 0.28, -0.93)).length());
    let surface = Surface { wrap: 0.2, ..Surface::matt(spot, white.lerp(color, rim)) };
    Surface { emission: Vec3::splat(0.9 * catch), ..surface }.glossy(0.5, 300.0)
}

fn frame(spot: &Spot) -> Surface {
    Surface::matt(spot, spot.tint).glossy(0.25, 60.0)
}
