//! Materials of the objects in the room.

use glam::Vec3;

use super::sdf::{linear_from_hex, smoothstep};
use crate::scene::noise::{fractal_noise, hash_cell, hash_to_unit, value_noise};
use crate::scene::part::{ShadingPoint, Surface};

pub fn shade_diffuse(point: &ShadingPoint) -> Surface {
    Surface::diffuse(point, point.tint)
}

/// Emission in the material's colour.
pub fn shade_emissive(point: &ShadingPoint) -> Surface {
    Surface { emission: point.tint, ..Surface::diffuse(point, Vec3::ZERO) }
}

/// Glazed clay with a light band.
pub fn shade_ceramic(point: &ShadingPoint) -> Surface {
    let speck = smoothstep(0.70, 0.78, value_noise(220.0 * point.p)) * 0.35;
    Surface::diffuse(point, point.tint * (1.0 - speck)).with_highlight(0.22, 50.0)
}

/// Brass and other dull metal.
pub fn shade_metal(point: &ShadingPoint) -> Surface {
    Surface::diffuse(point, point.tint * 0.7).with_highlight(0.7, 40.0)
}

/// Wood with its grain along `x`.
pub fn shade_wood(point: &ShadingPoint) -> Surface {
    shade_grain(point, point.p)
}

/// Wood with rings along `x`, warped by noise, and fine pores.
fn shade_grain(point: &ShadingPoint, p: Vec3) -> Surface {
    let offset = 31.0 * hash_to_unit(point.seed);
    let warp = fractal_noise(Vec3::new(1.6 * p.x + offset, 9.0 * p.y, 9.0 * p.z), 3);
    let ring = 0.5 + 0.5 * ((34.0 * (p.z + p.y) + 9.0 * warp) * 2.2).sin();
    let pore = value_noise(Vec3::new(14.0 * p.x, 260.0 * p.y + offset, 260.0 * p.z));
    let color = point.tint * (0.75 + 0.30 * ring * warp + 0.10 * pore);
    Surface::diffuse(point, color).with_highlight(0.10, 24.0)
}

/// Table boards along `x`: wood with dark joints every 16 cm of depth.
pub fn shade_boards(point: &ShadingPoint) -> Surface {
    let board = (point.p.z / 0.16).floor();
    let within = point.p.z / 0.16 - board;
    let joint = smoothstep(0.0, 0.02, within) * smoothstep(1.0, 0.98, within);
    let point = ShadingPoint {
        seed: board as i32 as u32,
        tint: point.tint * (0.85 + 0.3 * hash_cell(board as i32, 7)),
        ..*point
    };
    let surface = shade_wood(&point);
    Surface { albedo: surface.albedo * (0.4 + 0.6 * joint), ..surface }.with_highlight(0.16, 30.0)
}

/// A papered wall that faces the camera: rows of small leaves, with panelling and a rail below.
pub fn shade_wallpaper(point: &ShadingPoint) -> Surface {
    let p = point.p;
    let mottle = 0.93 + 0.14 * fractal_noise(7.0 * p, 3);
    if p.y < -0.47 {
        return shade_panelling(point, mottle);
    }
    // Tiles of 10.5 x 11.5 cm, every other row shifted by half; `u`, `v` are -1..1 within a tile.
    let row = (p.y / 0.115).floor();
    let x = p.x / 0.105 + 0.5 * (row - 2.0 * (0.5 * row).floor());
    let (u, v) = (2.0 * (x - x.floor()) - 1.0, 2.0 * (p.y / 0.115 - row) - 1.0);
    // A stem with two pairs of leaves.
    let leaf = |cx: f32, cy: f32, lean: f32| {
        let (a, b) = (u.abs() - cx, v - cy);
        let (along, across) = (a * lean + b * (1.0 - lean), b * lean - a * (1.0 - lean));
        smoothstep(0.14, 0.04, across.abs() + 0.9 * along * along)
    };
    let stem = smoothstep(0.06, 0.02, u.abs()) * smoothstep(0.75, 0.65, v.abs());
    let motif = leaf(0.30, 0.20, 0.55).max(leaf(0.30, -0.35, 0.55)).max(stem).max(leaf(0.0, 0.72, 0.0));
    Surface::diffuse(point, (point.tint * mottle).lerp(linear_from_hex(0x86a08a), 0.42 * motif))
}

/// Panels 42 cm wide with grooves between them, under a rail.
fn shade_panelling(point: &ShadingPoint, mottle: f32) -> Surface {
    let x = point.p.x / 0.42;
    let within = (x - x.floor() - 0.5).abs();
    let groove = smoothstep(0.455, 0.475, within) * smoothstep(0.5, 0.48, within);
    let rail = smoothstep(-0.505, -0.50, point.p.y);
    let tone = (1.0 - 0.45 * groove * (1.0 - rail)) * (0.9 + 0.1 * rail);
    Surface::diffuse(point, linear_from_hex(0x31504f) * mottle * tone)
}

/// A book's spine and boards: a title, two bands.
pub fn shade_book(point: &ShadingPoint) -> Surface {
    let band = (point.p.y * (70.0 + 40.0 * hash_to_unit(point.seed)) + 6.0 * hash_to_unit(point.seed ^ 5)).sin();
    // Only on the spine, which faces the camera.
    let gilt = smoothstep(0.93, 0.97, band) * smoothstep(-0.5, -0.8, point.normal.z);
    let worn = 0.85 + 0.3 * fractal_noise(40.0 * point.p, 2);
    Surface::diffuse(point, (point.tint * worn).lerp(linear_from_hex(0xd8b878), 0.8 * gilt)).with_highlight(0.05, 20.0)
}

pub fn shade_cloth(point: &ShadingPoint) -> Surface {
    let weave = value_noise(Vec3::new(300.0, 220.0, 300.0) * point.p);
    let soft = fractal_noise(14.0 * point.p, 3);
    Surface { wrap: 0.3, ..Surface::diffuse(point, point.tint * (0.77 + 0.12 * weave + 0.28 * soft)) }
}

/// A cloth with wide stripes across its width.
pub fn shade_stripes(point: &ShadingPoint) -> Surface {
    let wave = (point.p.x * 62.0 + point.p.y * 30.0).sin();
    let color = point
        .tint
        .lerp(linear_from_hex(0xf0dfc0), smoothstep(0.25, 0.45, wave))
        .lerp(linear_from_hex(0x9c3d2e), smoothstep(0.86, 0.93, wave));
    shade_cloth(&ShadingPoint { tint: color, ..*point })
}

/// A curtain: translucent cloth in front of the evening light.
pub fn shade_curtain(point: &ShadingPoint) -> Surface {
    let surface = shade_cloth(point);
    Surface { emission: 0.05 * point.tint * Vec3::new(0.5, 0.62, 1.0), wrap: 0.45, ..surface }
}

/// A lamp shade, lit from inside: brightest at the height of the bulb.
pub fn shade_lamp_shade(point: &ShadingPoint) -> Surface {
    let middle = (-((point.uv.y - 0.45) / 0.42).powi(2)).exp();
    let thread = 0.92 + 0.16 * value_noise(Vec3::new(10.0 * point.uv.x, 160.0 * point.p.y, 1.0));
    let glow = point.tint * (0.35 + 0.65 * middle) * thread;
    Surface { emission: glow, ..Surface::diffuse(point, linear_from_hex(0xe8d9b8)) }
}

/// A leaf on a quad: a lighter midrib and side ribs, slightly translucent.
pub fn shade_leaf(point: &ShadingPoint) -> Surface {
    let (u, v) = (point.uv.x, point.uv.y);
    let rib =
        smoothstep(0.06, 0.02, v.abs()) + 0.5 * smoothstep(0.16, 0.04, ((9.0 * (u - 0.55 * v.abs())).sin()).abs());
    let tone = 0.78
        + 0.3 * hash_to_unit(point.seed)
        + 0.25 * (fractal_noise(Vec3::new(3.0 * u, 3.0 * v, hash_to_unit(point.seed) * 50.0), 3) - 0.5);
    let color = (point.tint * tone).lerp(linear_from_hex(0xb9cf8a), 0.25 * rib.min(1.0));
    Surface { wrap: 0.5, emission: 0.015 * color, ..Surface::diffuse(point, color) }.with_highlight(0.07, 18.0)
}

/// A small picture under glass: hills and a sun.
pub fn shade_landscape(point: &ShadingPoint) -> Surface {
    let (u, v) = (point.uv.x, point.uv.y);
    if u.abs() > 0.72 || v.abs() > 0.76 {
        return Surface::diffuse(point, linear_from_hex(0xece4d4));
    }
    let hill = |height: f32, wave: f32, at: f32| smoothstep(0.0, 0.03, height + 0.16 * (wave * u + at).sin() - v);
    let sky = linear_from_hex(0xe9b48a).lerp(linear_from_hex(0x7fa0ad), 0.5 + 0.6 * v);
    let sun = smoothstep(0.17, 0.14, ((u - 0.25).powi(2) + (v - 0.25).powi(2)).sqrt());
    let color = sky.lerp(linear_from_hex(0xf8e7b0), sun);
    let color = color
        .lerp(linear_from_hex(0x6f8f86), hill(0.0, 3.1, 0.4))
        .lerp(linear_from_hex(0x3f6660), hill(-0.25, 4.0, 2.0));
    Surface::diffuse(point, color.lerp(linear_from_hex(0x284743), hill(-0.5, 3.0, 4.2)))
}
