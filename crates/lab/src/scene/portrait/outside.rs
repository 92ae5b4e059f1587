//! The view through the window: dusk, houses with lit windows, a street with its lights.

use glam::{Mat3, Vec3};

use super::form::{hex, step};
use super::paint::glow;
use crate::scene::noise::{Dice, cell, fractal};
use crate::scene::part::{Material, Part, Spot, Surface};
use crate::scene::shape::{Shape, whole};

/// Creates the view, which is self-luminous: the room's lamps do not light it.
pub fn part() -> Part {
    let mut part = Part::still();
    let sky = Shape::Quad { centre: Vec3::new(-3.0, 1.0, 12.8), right: 8.0 * Vec3::X, up: 5.0 * Vec3::Y, cut: whole };
    part.add(sky, Material::new(dusk, Vec3::ONE));
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
        part.add(shape, Material::new(house, hex(0x2a3448)).seeded(k as u32));
    }
    let street =
        Shape::Quad { centre: Vec3::new(-3.5, -1.75, 9.0), right: 6.0 * Vec3::X, up: 4.2 * Vec3::Z, cut: whole };
    part.add(street, Material::new(asphalt, hex(0x1b2029)));
    add_trees(&mut part);
    add_lights(&mut part);
    part
}

fn add_trees(part: &mut Part) {
    for (k, (x, y, z, radius)) in
        [(-3.9, -0.75, 8.4, 0.42), (-1.75, -0.55, 8.8, 0.40), (-2.7, -1.0, 9.6, 0.35)].into_iter().enumerate()
    {
        let mut dice = Dice::new(70 + k as u32);
        for _ in 0..9 {
            let centre = Vec3::new(x, y, z) + 0.62 * radius * dice.direction();
            let shape = Shape::Sphere { centre, radius: radius * dice.between(0.35, 0.6) };
            part.add(shape, Material::new(foliage, hex(0x2c4038)));
        }
        part.add_chain(
            &[(Vec3::new(x, y, z), 0.03), (Vec3::new(x, -1.8, z), 0.045)],
            Material::new(foliage, hex(0x201a18)),
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
    let mut dice = Dice::new(5);
    let palette = [(warm, 6.0), (white, 9.0), (amber, 5.0), (red, 4.0), (teal, 3.5), (rose, 4.0), (warm, 12.0)];
    // Shop signs, signals and cars: one per cell of a loose grid, so that their discs seldom overlap.
    for row in 0..4 {
        for column in 0..8 {
            if dice.next() < 0.22 {
                continue;
            }
            let z = dice.between(6.5, 10.2);
            // Slopes of rays: evenly spaced in the picture, at any depth.
            let u = -0.455 + 0.052 * (column as f32 + dice.between(0.15, 0.85));
            let v = -0.135 + 0.062 * (row as f32 + dice.between(0.15, 0.85));
            let (color, power) = palette[(dice.next() * palette.len() as f32) as usize % palette.len()];
            let size = dice.between(0.0032, 0.0056);
            lights.push((Vec3::new(u * z, v * z, z), size * z, power * color));
        }
    }
    for (centre, radius, radiance) in lights {
        part.add(Shape::Sphere { centre, radius }, Material::new(glow, radiance));
    }
}

fn dusk(spot: &Spot) -> Surface {
    let y = spot.p.y;
    let low = hex(0xf0a070).lerp(hex(0xb5748c), step(-1.2, 0.7, y));
    let color = low.lerp(hex(0x3b4f86), step(0.2, 2.2, y)).lerp(hex(0x1c2a58), step(1.6, 4.2, y));
    let cloud = step(0.50, 0.72, fractal(Vec3::new(0.5 * spot.p.x, 1.9 * y, 2.0), 4));
    Surface { emission: 0.62 * color.lerp(hex(0xf3b79a), 0.35 * cloud), ..Surface::matt(spot, Vec3::ZERO) }
}

/// A hazy front with rows of windows, two of five of which are lit.
fn house(spot: &Spot) -> Surface {
    let p = spot.p;
    let haze = 0.55 * hex(0x4a4a72) * (0.55 + 0.25 * fractal(1.5 * p, 2));
    let (x, y) = (p.x / 0.165, p.y / 0.205);
    let (column, row) = (x.floor(), y.floor());
    let (u, v) = ((x - column - 0.5).abs(), (y - row - 0.5).abs());
    let pane = step(0.32, 0.28, u) * step(0.34, 0.30, v) * f32::from(spot.normal.z < -0.5);
    let chance = cell(column as i32 + 31 * spot.seed as i32, row as i32);
    let hue = cell(row as i32 - 9, column as i32 + 17 * spot.seed as i32);
    let warm = hex(0xffb45a).lerp(hex(0xffe2b0), hue);
    let bars = 1.0 - 0.35 * step(0.04, 0.02, u);
    let lit = if chance < 0.40 { (0.35 + 1.15 * hue) * bars * warm } else { 0.10 * hex(0x8090c0) };
    Surface { emission: haze.lerp(lit, pane), ..Surface::matt(spot, Vec3::ZERO) }
}

fn asphalt(spot: &Spot) -> Surface {
    let p = spot.p;
    // Wet asphalt: sky and lamps are reflected in streaks.
    let streak = fractal(Vec3::new(4.5 * p.x, 0.0, 0.5 * p.z), 3);
    let light = spot.tint + 0.55 * hex(0xd08a58) * step(0.48, 0.78, streak) + 0.10 * hex(0x5a6aa0);
    Surface { emission: light, ..Surface::matt(spot, Vec3::ZERO) }
}

fn foliage(spot: &Spot) -> Surface {
    let clump = fractal(14.0 * spot.p, 3);
    let top = 0.5 + 0.5 * spot.normal.y;
    let light = spot.tint * (0.35 + 0.8 * clump) * (0.5 + 0.6 * top);
    Surface { emission: 0.7 * light + 0.03 * hex(0xffa050) * clump, ..Surface::matt(spot, Vec3::ZERO) }
}
