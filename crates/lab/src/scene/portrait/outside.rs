//! The view through the window: dusk, houses with lit windows, a street with its lights.

use glam::{Mat3, Vec3};

use super::materials::shade_emissive;
use super::sdf::{linear_from_hex, smoothstep};
use crate::scene::noise::{Rng, fractal_noise, hash_cell};
use crate::scene::part::{Material, Part, ShadingPoint, Surface};
use crate::scene::shape::{Shape, keep_whole};

/// Creates the view, which is self-luminous: the room's lamps do not light it.
pub fn create_part() -> Part {
    let mut part = Part::new_static();
    let sky =
        Shape::Quad { centre: Vec3::new(-3.0, 1.0, 12.8), right: 8.0 * Vec3::X, up: 5.0 * Vec3::Y, cut: keep_whole };
    part.add(sky, Material::new(shade_dusk_sky, Vec3::ONE));
    // x of the middle, height of the roof, depth of the front, half the width.
    let houses = [
        (-6.3, 1.5, 11.8, 0.75),
        (-5.0, 0.55, 12.2, 0.60),
        (-4.1, 1.9, 12.0, 0.42),
        (-3.0, 1.0, 11.6, 0.62),
        (-2.05, 1.6, 12.3, 0.45),
        (-1.2, 0.7, 11.9, 0.50),
        (-4.6, -0.2, 10.6, 0.55),
        (-2.3, 0.05, 10.4, 0.50),
    ];
    for (k, (x, roof, z, half)) in houses.into_iter().enumerate() {
        let height = 0.5 * (roof + 3.0);
        let shape = Shape::Cuboid {
            centre: Vec3::new(x, roof - height, z + 0.3),
            axes: Mat3::IDENTITY,
            half: Vec3::new(half, height, 0.3),
        };
        part.add(shape, Material::new(shade_house, linear_from_hex(0x2a3448)).with_seed(k as u32));
    }
    let street =
        Shape::Quad { centre: Vec3::new(-3.5, -1.75, 9.0), right: 6.0 * Vec3::X, up: 4.2 * Vec3::Z, cut: keep_whole };
    part.add(street, Material::new(shade_asphalt, linear_from_hex(0x1b2029)));
    add_trees(&mut part);
    add_lights(&mut part);
    part
}

fn add_trees(part: &mut Part) {
    for (k, (x, y, z, radius)) in
        [(-3.9, -0.75, 8.4, 0.42), (-1.75, -0.55, 8.8, 0.40), (-2.7, -1.0, 9.6, 0.35)].into_iter().enumerate()
    {
        let mut rng = Rng::new(70 + k as u32);
        for _ in 0..9 {
            let centre = Vec3::new(x, y, z) + 0.62 * radius * rng.direction();
            let shape = Shape::Sphere { centre, radius: radius * rng.between(0.35, 0.6) };
            part.add(shape, Material::new(shade_foliage, linear_from_hex(0x2c4038)));
        }
        part.add_chain(
            &[(Vec3::new(x, y, z), 0.03), (Vec3::new(x, -1.8, z), 0.045)],
            Material::new(shade_foliage, linear_from_hex(0x201a18)),
        );
    }
}

/// Adds street lamps in two rows, and small lights between them: the highlights that become discs in the blur.
fn add_lights(part: &mut Part) {
    let warm = Vec3::new(1.0, 0.52, 0.13);
    let amber = Vec3::new(1.0, 0.36, 0.05);
    let white = Vec3::new(1.0, 0.80, 0.50);
    let red = Vec3::new(1.0, 0.07, 0.04);
    let teal = Vec3::new(0.08, 0.85, 0.72);
    let rose = Vec3::new(1.0, 0.16, 0.30);
    // The two rows of street lamps run away from the camera.
    let mut lights: Vec<(Vec3, f32, Vec3)> = Vec::new();
    for k in 0..6 {
        let z = 5.6 * 1.14f32.powi(k);
        lights.push((Vec3::new(-2.36, 0.52, z), 0.045, 8.0 * warm));
        lights.push((Vec3::new(-0.98, 0.34, z + 0.3), 0.040, 6.0 * amber));
    }
    let mut rng = Rng::new(5);
    let palette = [(warm, 6.0), (white, 9.0), (amber, 5.0), (red, 4.0), (teal, 3.5), (rose, 4.0), (warm, 12.0)];
    // Shop signs, signals and cars: one per cell of a loose grid, so that their discs seldom overlap.
    for row in 0..4 {
        for column in 0..8 {
            if rng.next() < 0.22 {
                continue;
            }
            let z = rng.between(6.5, 10.2);
            // Slopes of rays: evenly spaced in the picture, at any depth.
            let u = -0.455 + 0.052 * (column as f32 + rng.between(0.15, 0.85));
            let v = -0.135 + 0.062 * (row as f32 + rng.between(0.15, 0.85));
            let (color, power) = palette[(rng.next() * palette.len() as f32) as usize % palette.len()];
            let size = rng.between(0.0032, 0.0056);
            lights.push((Vec3::new(u * z, v * z, z), size * z, power * color));
        }
    }
    for (centre, radius, radiance) in lights {
        part.add(Shape::Sphere { centre, radius }, Material::new(shade_emissive, radiance));
    }
}

fn shade_dusk_sky(point: &ShadingPoint) -> Surface {
    let y = point.p.y;
    let low = linear_from_hex(0xf0a070).lerp(linear_from_hex(0xb5748c), smoothstep(-1.2, 0.7, y));
    let color = low
        .lerp(linear_from_hex(0x3b4f86), smoothstep(0.2, 2.2, y))
        .lerp(linear_from_hex(0x1c2a58), smoothstep(1.6, 4.2, y));
    let cloud = smoothstep(0.50, 0.72, fractal_noise(Vec3::new(0.5 * point.p.x, 1.9 * y, 2.0), 4));
    Surface {
        emission: 0.62 * color.lerp(linear_from_hex(0xf3b79a), 0.35 * cloud),
        ..Surface::diffuse(point, Vec3::ZERO)
    }
}

/// A hazy front with rows of windows, two of five of which are lit.
fn shade_house(point: &ShadingPoint) -> Surface {
    let p = point.p;
    let haze = 0.55 * linear_from_hex(0x4a4a72) * (0.55 + 0.25 * fractal_noise(1.5 * p, 2));
    let (x, y) = (p.x / 0.165, p.y / 0.205);
    let (column, row) = (x.floor(), y.floor());
    let (u, v) = ((x - column - 0.5).abs(), (y - row - 0.5).abs());
    let pane = smoothstep(0.32, 0.28, u) * smoothstep(0.34, 0.30, v) * f32::from(point.normal.z < -0.5);
    let chance = hash_cell(column as i32 + 31 * point.seed as i32, row as i32);
    let hue = hash_cell(row as i32 - 9, column as i32 + 17 * point.seed as i32);
    let warm = linear_from_hex(0xffb45a).lerp(linear_from_hex(0xffe2b0), hue);
    let bars = 1.0 - 0.35 * smoothstep(0.04, 0.02, u);
    let lit = if chance < 0.40 { (0.35 + 1.15 * hue) * bars * warm } else { 0.10 * linear_from_hex(0x8090c0) };
    Surface { emission: haze.lerp(lit, pane), ..Surface::diffuse(point, Vec3::ZERO) }
}

fn shade_asphalt(point: &ShadingPoint) -> Surface {
    let p = point.p;
    // Wet asphalt: sky and lamps are reflected in streaks.
    let streak = fractal_noise(Vec3::new(4.5 * p.x, 0.0, 0.5 * p.z), 3);
    let light = point.tint
        + 0.55 * linear_from_hex(0xd08a58) * smoothstep(0.48, 0.78, streak)
        + 0.10 * linear_from_hex(0x5a6aa0);
    Surface { emission: light, ..Surface::diffuse(point, Vec3::ZERO) }
}

fn shade_foliage(point: &ShadingPoint) -> Surface {
    let clump = fractal_noise(14.0 * point.p, 3);
    let top = 0.5 + 0.5 * point.normal.y;
    let light = point.tint * (0.35 + 0.8 * clump) * (0.5 + 0.6 * top);
    Surface { emission: 0.7 * light + 0.03 * linear_from_hex(0xffa050) * clump, ..Surface::diffuse(point, Vec3::ZERO) }
}
