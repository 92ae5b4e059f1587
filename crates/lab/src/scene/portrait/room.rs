//! The room behind the subject: wall, window frame, shelf with books, sideboard with a lamp.

use std::sync::Arc;

use glam::{Mat3, Vec2, Vec3};

use super::front::is_in_half_leaf;
use super::materials;
use super::sdf::{linear_from_hex, rounded_box};
use super::seats::{TABLE, add_seats, pillow_distance, sofa_distance};
use crate::scene::grid::DistanceGrid;
use crate::scene::noise::{Rng, hash_to_unit};
use crate::scene::part::{Material, Part, SurfaceShader};
use crate::scene::ray::BoundingBox;
use crate::scene::shape::{Shape, keep_whole};

/// Depth of the wall.
const WALL_M: f32 = 4.2;
/// The window's opening: lower left and upper right corner.
const WINDOW: (Vec2, Vec2) = (Vec2::new(-1.84, -0.62), Vec2::new(-0.46, 1.30));
pub const FLOOR_Y: f32 = -1.02;

/// Creates the room behind the subject.
pub fn create_part() -> Part {
    let mut part = Part::new_static();
    let around = BoundingBox { low: Vec3::new(-2.2, FLOOR_Y - 0.02, 1.75), high: Vec3::new(2.3, 1.1, WALL_M + 0.05) };
    let grid = Arc::new(DistanceGrid::new(room_distance, around, 0.03));
    add_walls(&mut part);
    add_window(&mut part);
    add_shelves(&mut part);
    add_sideboard(&mut part);
    add_fairy_lights(&mut part);
    add_seats(&mut part, &grid);
    part.distance_grid = Some(grid);
    part
}

/// Adds an axis-aligned box between two opposite corners.
pub fn add_box(part: &mut Part, low: [f32; 3], high: [f32; 3], material: Material) {
    let (low, high) = (Vec3::from(low), Vec3::from(high));
    let shape = Shape::Cuboid { centre: 0.5 * (low + high), axes: Mat3::IDENTITY, half: 0.5 * (high - low) };
    part.add(shape, material);
}

/// Creates a material of one colour, `0xRRGGBB`.
pub fn create_material(shader: SurfaceShader, code: u32) -> Material {
    Material::new(shader, linear_from_hex(code))
}

fn add_walls(part: &mut Part) {
    let wall = create_material(materials::shade_wallpaper, 0x3d6663);
    let (low, high) = WINDOW;
    add_box(part, [-4.0, -1.4, WALL_M], [low.x, 1.8, WALL_M + 0.12], wall);
    add_box(part, [high.x, -1.4, WALL_M], [4.0, 1.8, WALL_M + 0.12], wall);
    add_box(part, [low.x, -1.4, WALL_M], [high.x, low.y, WALL_M + 0.12], wall);
    let floor =
        Shape::Quad { centre: Vec3::new(0.0, FLOOR_Y, 3.0), right: 4.0 * Vec3::X, up: 2.0 * Vec3::Z, cut: keep_whole };
    part.add(floor, create_material(materials::shade_boards, 0x7a5233));
    add_box(
        part,
        [-4.0, FLOOR_Y, WALL_M - 0.02],
        [4.0, FLOOR_Y + 0.09, WALL_M],
        create_material(materials::shade_diffuse, 0x2a4442),
    );
}

/// Adds frame and sill, curtains, and pots on the sill.
fn add_window(part: &mut Part) {
    let white = create_material(materials::shade_diffuse, 0xd9d2c4);
    let (low, high) = WINDOW;
    let bar = 0.028;
    let across = 0.5 * (low.x + high.x);
    for x in [low.x, across, high.x] {
        add_box(part, [x - bar, low.y, WALL_M - 0.02], [x + bar, high.y, WALL_M + 0.06], white);
    }
    for y in [low.y, 0.42] {
        add_box(part, [low.x, y - bar, WALL_M - 0.015], [high.x, y + bar, WALL_M + 0.05], white);
    }
    add_box(part, [low.x - 0.08, low.y - 0.06, WALL_M - 0.20], [high.x + 0.08, low.y - 0.02, WALL_M], white);
    // Curtains hang in pleats.
    let linen = create_material(materials::shade_curtain, 0xcdb892);
    for (from, count) in [(low.x - 0.30, 9), (high.x - 0.06, 6)] {
        for k in 0..count {
            let x = from + 0.042 * k as f32;
            let z = WALL_M - 0.17 + 0.030 * (k as f32 * 2.4).sin();
            let sway = 0.012 * (k as f32 * 1.7).sin();
            let pleat = [(Vec3::new(x + sway, -0.98, z), 0.036), (Vec3::new(x, 1.45, z), 0.030)];
            part.add_chain(&pleat, linen);
        }
    }
    for (k, x) in [-1.45f32, -1.14, -0.80].into_iter().enumerate() {
        let radius = 0.052 + 0.008 * k as f32;
        let foot = Vec3::new(x, low.y - 0.02, WALL_M - 0.10);
        add_pot(part, foot, radius, [0xb5643c, 0xd8cfbf, 0x8a6d8f][k], 40 + k as u32, 0.7);
    }
}

/// Adds a pot with a tuft of leaves of two halves each.
fn add_pot(part: &mut Part, foot: Vec3, radius: f32, color: u32, seed: u32, spread: f32) {
    let height = 1.7 * radius;
    let pot = Shape::Frustum { base: foot, height, low_radius: 0.75 * radius, high_radius: radius };
    part.add(pot, create_material(materials::shade_ceramic, color));
    let soil = Shape::Quad {
        centre: foot + 0.9 * height * Vec3::Y,
        right: radius * Vec3::X,
        up: radius * Vec3::Z,
        cut: |uv| uv.length_squared() < 0.95,
    };
    part.add(soil, create_material(materials::shade_diffuse, 0x2b1d14));
    let mut rng = Rng::new(seed);
    let top = foot + 0.9 * height * Vec3::Y;
    for _ in 0..26 {
        let out = (spread * rng.direction() * Vec3::new(1.0, 0.5, 1.0) + rng.between(0.35, 1.0) * Vec3::Y)
            .normalize_or(Vec3::Y);
        let length = radius * rng.between(0.7, 1.25);
        let across = out.cross(Vec3::Z + 0.5 * rng.direction()).normalize_or(Vec3::X) * 0.36 * length;
        let green = linear_from_hex(0x3c6b3a).lerp(linear_from_hex(0x7fa35a), rng.next());
        let centre = top + out * (length + radius * rng.between(0.0, 0.9));
        part.add_chain(&[(top, 0.003), (centre, 0.002)], create_material(materials::shade_diffuse, 0x4d6b3d));
        for side in [-1.0, 1.0] {
            let wing = side * across + 0.08 * length * Vec3::Y;
            let shape = Shape::Quad { centre, right: length * out, up: wing, cut: is_in_half_leaf };
            part.add(shape, Material::new(materials::shade_leaf, green).with_seed(seed + length.to_bits()));
        }
    }
}

const BOOKS: [u32; 9] = [0x9c3b34, 0x2f5d73, 0xd8a24a, 0x54734f, 0x7d4b63, 0xc9bda3, 0x33415e, 0xb5643c, 0x8a8f5c];

/// Adds two boards with books and pots, and a picture on the wall.
fn add_shelves(part: &mut Part) {
    let board = create_material(materials::shade_wood, 0x8a5a33);
    let mut rng = Rng::new(3);
    for (y, from, to) in [(0.20f32, 0.66f32, 2.16f32), (0.66, 0.84, 2.16)] {
        add_box(part, [from, y - 0.032, 3.93], [to, y, WALL_M], board);
        for x in [from + 0.12, to - 0.3] {
            add_box(
                part,
                [x, y - 0.13, 4.0],
                [x + 0.025, y - 0.032, WALL_M],
                create_material(materials::shade_metal, 0x4a3a28),
            );
        }
        let mut x = from + 0.06;
        while x < to - 0.10 {
            // A pot, a gap, or a book; some books lean.
            let kind = rng.next();
            if kind < 0.13 && x > from + 0.2 {
                let radius = rng.between(0.055, 0.075);
                let pot = Vec3::new(x + 1.2 * radius, y, 4.06);
                add_pot(part, pot, radius, BOOKS[(rng.next() * 9.0) as usize % 9], (x * 977.0) as u32, 0.8);
                x += 2.6 * radius;
            } else if kind < 0.20 {
                x += rng.between(0.05, 0.12);
            } else {
                let width = rng.between(0.026, 0.056);
                let height = rng.between(0.19, 0.30);
                let depth = rng.between(0.12, 0.17);
                let lean = if kind > 0.93 { 0.16 } else { 0.0 };
                let centre =
                    Vec3::new(x + 0.5 * width + 0.5 * height * lean, y + 0.5 * height, WALL_M - 0.04 - 0.5 * depth);
                let half = 0.5 * Vec3::new(width - 0.002, height, depth);
                let code = BOOKS[(rng.next() * 9.0) as usize % 9];
                let seed = (x * 1e4) as u32;
                part.add(
                    Shape::Cuboid { centre, axes: Mat3::from_rotation_z(-lean), half },
                    create_material(materials::shade_book, code).with_seed(seed),
                );
                x += width + height * lean;
            }
        }
    }
    // A framed picture between the window and the shelves.
    add_box(part, [0.02, 0.44, 4.165], [0.52, 0.84, WALL_M], create_material(materials::shade_wood, 0x5d3b22));
    let canvas = Shape::Quad {
        centre: Vec3::new(0.27, 0.64, 4.163),
        right: 0.225 * Vec3::X,
        up: 0.175 * Vec3::Y,
        cut: keep_whole,
    };
    part.add(canvas, create_material(materials::shade_landscape, 0xffffff));
}

/// Adds a sideboard with three doors; on it a lamp, a pot and a pile of books.
fn add_sideboard(part: &mut Part) {
    let walnut = create_material(materials::shade_wood, 0x6d4527);
    add_box(
        part,
        [0.62, -0.455, 3.70],
        [2.30, -0.42, WALL_M],
        create_material(materials::shade_wood, 0x8a5a33).with_seed(4),
    );
    add_box(part, [0.65, -0.95, 3.73], [2.27, -0.455, WALL_M], walnut);
    for k in 0..3 {
        let x = 0.68 + 0.53 * k as f32;
        add_box(part, [x, -0.92, 3.715], [x + 0.50, -0.48, 3.735], walnut.with_seed(9 + k));
        let knob = Shape::Sphere { centre: Vec3::new(x + 0.44, -0.66, 3.705), radius: 0.016 };
        part.add(knob, create_material(materials::shade_metal, 0xc59a4a));
    }
    // The lamp.
    let foot = Vec3::new(1.42, -0.42, 3.92);
    let belly = Shape::ellipsoid(foot + 0.085 * Vec3::Y, Mat3::IDENTITY, Vec3::new(0.085, 0.085, 0.085));
    part.add(belly, create_material(materials::shade_ceramic, 0x2f6f73));
    part.add_chain(
        &[(foot + 0.16 * Vec3::Y, 0.012), (foot + 0.30 * Vec3::Y, 0.010)],
        create_material(materials::shade_metal, 0xc59a4a),
    );
    let shade = Shape::Frustum { base: foot + 0.235 * Vec3::Y, height: 0.22, low_radius: 0.175, high_radius: 0.115 };
    part.add(shade, Material::new(materials::shade_lamp_shade, Vec3::new(1.25, 0.80, 0.40)));
    add_pot(part, Vec3::new(0.86, -0.42, 3.92), 0.095, 0xc9bda3, 61, 1.0);
    for k in 0..4u32 {
        let y = -0.42 + 0.034 * k as f32;
        let shift = 0.02 * hash_to_unit(k) - 0.01;
        let code = BOOKS[(2 * k as usize + 1) % 9];
        let low = [1.82 + shift, y, 3.80];
        add_box(part, low, [2.08 + shift, y + 0.032, 3.98], create_material(materials::shade_book, code).with_seed(k));
    }
}

/// Adds strings of bulbs along the wall.
fn add_fairy_lights(part: &mut Part) {
    let wire = create_material(materials::shade_diffuse, 0x2c2a26);
    let drapes = [
        (Vec3::new(-0.36, 0.98, 4.08), Vec3::new(0.66, 1.03, 4.10), 0.16, 13),
        (Vec3::new(0.66, 1.03, 4.10), Vec3::new(2.2, 1.00, 4.08), 0.13, 17),
        (Vec3::new(0.64, 0.19, 3.925), Vec3::new(2.18, 0.19, 3.925), 0.085, 18),
    ];
    for (from, to, sag, count) in drapes {
        // A parabola approximates the catenary.
        let at = |s: f32| from + (to - from) * s - 4.0 * sag * s * (1.0 - s) * Vec3::Y;
        let line: Vec<_> = (0..=24).map(|i| (at(i as f32 / 24.0), 0.0025)).collect();
        part.add_chain(&line, wire);
        for k in 0..count {
            let s = (k as f32 + 0.5) / count as f32;
            let centre = at(s) - 0.016 * Vec3::Y;
            let power = 7.0 + 5.0 * hash_to_unit(k + 31);
            let bulb = Shape::Sphere { centre, radius: 0.015 };
            part.add(bulb, Material::new(materials::shade_emissive, power * Vec3::new(1.0, 0.46, 0.09)));
        }
    }
}

/// Returns the signed distance to the large objects of the room, for shadow and occlusion; also the guide of sofa and
/// pillow.
fn room_distance(p: Vec3) -> f32 {
    let wall = WALL_M - p.z;
    let (low, high) = WINDOW;
    let window = rounded_box(
        p - Vec3::new(0.5 * (low.x + high.x), 0.5 * (low.y + high.y), WALL_M),
        Vec3::new(0.5 * (high.x - low.x), 0.5 * (high.y - low.y), 0.3),
        0.0,
    );
    let board = |y: f32, from: f32| {
        let half = 0.5 * (2.16 - from);
        rounded_box(p - Vec3::new(from + half, y - 0.016, 4.07), Vec3::new(half, 0.016, 0.14), 0.0)
    };
    let side = rounded_box(p - Vec3::new(1.46, -0.69, 3.96), Vec3::new(0.83, 0.27, 0.25), 0.0);
    let table = rounded_box(p - TABLE - Vec3::new(0.065, -0.015, 0.0), Vec3::new(0.685, 0.015, 0.55), 0.0);
    wall.max(-window)
        .min(p.y - FLOOR_Y)
        .min(board(0.20, 0.66))
        .min(board(0.66, 0.84))
        .min(side)
        .min(table)
        .min(sofa_distance(p))
        .min(pillow_distance(p))
}
