//! Paints of the objects in the room.

use glam::Vec3;

use super::form::{hex, step};
use crate::scene::noise::{cell, fractal, unit, value};
use crate::scene::part::{Spot, Surface};

pub fn plain(spot: &Spot) -> Surface {
    Surface::matt(spot, spot.tint)
}

/// Emission in the material's colour.
pub fn glow(spot: &Spot) -> Surface {
    Surface { emission: spot.tint, ..Surface::matt(spot, Vec3::ZERO) }
}

/// Glazed clay with a light band.
pub fn ceramic(spot: &Spot) -> Surface {
    let speck = step(0.70, 0.78, value(220.0 * spot.p)) * 0.35;
    Surface::matt(spot, spot.tint * (1.0 - speck)).glossy(0.22, 50.0)
}

/// Brass and other dull metal.
pub fn metal(spot: &Spot) -> Surface {
    Surface::matt(spot, spot.tint * 0.7).glossy(0.7, 40.0)
}

/// Wood with its grain along `x`.
pub fn wood(spot: &Spot) -> Surface {
    grain(spot, spot.p)
}

/// Wood with rings along `x`, warped by noise, and fine pores.
fn grain(spot: &Spot, p: Vec3) -> Surface {
    let offset = 31.0 * unit(spot.seed);
    let warp = fractal(Vec3::new(1.6 * p.x + offset, 9.0 * p.y, 9.0 * p.z), 3);
    let ring = 0.5 + 0.5 * ((34.0 * (p.z + p.y) + 9.0 * warp) * 2.2).sin();
    let pore = value(Vec3::new(14.0 * p.x, 260.0 * p.y + offset, 260.0 * p.z));
    let color = spot.tint * (0.75 + 0.30 * ring * warp + 0.10 * pore);
    Surface::matt(spot, color).glossy(0.10, 24.0)
}

/// Table boards along `x`: wood with dark joints every 16 cm of depth.
pub fn boards(spot: &Spot) -> Surface {
    let board = (spot.p.z / 0.16).floor();
    let within = spot.p.z / 0.16 - board;
    let joint = step(0.0, 0.02, within) * step(1.0, 0.98, within);
    let spot = Spot { seed: board as i32 as u32, tint: spot.tint * (0.85 + 0.3 * cell(board as i32, 7)), ..*spot };
    let surface = wood(&spot);
    Surface { albedo: surface.albedo * (0.4 + 0.6 * joint), ..surface }.glossy(0.16, 30.0)
}

/// A papered wall that faces the camera: rows of small leaves, with panelling and a rail below.
pub fn wallpaper(spot: &Spot) -> Surface {
    let p = spot.p;
    let mottle = 0.93 + 0.14 * fractal(7.0 * p, 3);
    if p.y < -0.47 {
        return panelling(spot, mottle);
    }
    // Tiles of 10.5 x 11.5 cm, every other row shifted by half; `u`, `v` are -1..1 within a tile.
    let row = (p.y / 0.115).floor();
    let x = p.x / 0.105 + 0.5 * (row - 2.0 * (0.5 * row).floor());
    let (u, v) = (2.0 * (x - x.floor()) - 1.0, 2.0 * (p.y / 0.115 - row) - 1.0);
    // A stem with two pairs of leaves.
    let leaf = |cx: f32, cy: f32, lean: f32| {
        let (a, b) = (u.abs() - cx, v - cy);
        let (along, across) = (a * lean + b * (1.0 - lean), b * lean - a * (1.0 - lean));
        step(0.14, 0.04, across.abs() + 0.9 * along * along)
    };
    let stem = step(0.06, 0.02, u.abs()) * step(0.75, 0.65, v.abs());
    let motif = leaf(0.30, 0.20, 0.55).max(leaf(0.30, -0.35, 0.55)).max(stem).max(leaf(0.0, 0.72, 0.0));
    Surface::matt(spot, (spot.tint * mottle).lerp(hex(0x86a08a), 0.42 * motif))
}

/// Panels 42 cm wide with grooves between them, under a rail.
fn panelling(spot: &Spot, mottle: f32) -> Surface {
    let x = spot.p.x / 0.42;
    let within = (x - x.floor() - 0.5).abs();
    let groove = step(0.455, 0.475, within) * step(0.5, 0.48, within);
    let rail = step(-0.505, -0.50, spot.p.y);
    let tone = (1.0 - 0.45 * groove * (1.0 - rail)) * (0.9 + 0.1 * rail);
    Surface::matt(spot, hex(0x31504f) * mottle * tone)
}

/// A book's spine and boards: a title, two bands.
pub fn book(spot: &Spot) -> Surface {
    let band = (spot.p.y * (70.0 + 40.0 * unit(spot.seed)) + 6.0 * unit(spot.seed ^ 5)).sin();
    // Only on the spine, which faces the camera.
    let gilt = step(0.93, 0.97, band) * step(-0.5, -0.8, spot.normal.z);
    let worn = 0.85 + 0.3 * fractal(40.0 * spot.p, 2);
    Surface::matt(spot, (spot.tint * worn).lerp(hex(0xd8b878), 0.8 * gilt)).glossy(0.05, 20.0)
}

pub fn cloth(spot: &Spot) -> Surface {
    let weave = value(Vec3::new(300.0, 220.0, 300.0) * spot.p);
    let soft = fractal(14.0 * spot.p, 3);
    Surface { wrap: 0.3, ..Surface::matt(spot, spot.tint * (0.77 + 0.12 * weave + 0.28 * soft)) }
}

/// A cloth with wide stripes across its width.
pub fn stripes(spot: &Spot) -> Surface {
    let wave = (spot.p.x * 62.0 + spot.p.y * 30.0).sin();
    let color = spot.tint.lerp(hex(0xf0dfc0), step(0.25, 0.45, wave)).lerp(hex(0x9c3d2e), step(0.86, 0.93, wave));
    cloth(&Spot { tint: color, ..*spot })
}

/// A curtain: translucent cloth in front of the evening light.
pub fn curtain(spot: &Spot) -> Surface {
    let surface = cloth(spot);
    Surface { emission: 0.05 * spot.tint * Vec3::new(0.5, 0.62, 1.0), wrap: 0.45, ..surface }
}

/// A lamp shade, lit from inside: brightest at the height of the bulb.
pub fn lamp_shade(spot: &Spot) -> Surface {
    let middle = (-((spot.uv.y - 0.45) / 0.42).powi(2)).exp();
    let thread = 0.92 + 0.16 * value(Vec3::new(10.0 * spot.uv.x, 160.0 * spot.p.y, 1.0));
    let glow = spot.tint * (0.35 + 0.65 * middle) * thread;
    Surface { emission: glow, ..Surface::matt(spot, hex(0xe8d9b8)) }
}

/// A leaf on a quad: a lighter midrib and side ribs, slightly translucent.
pub fn leaf(spot: &Spot) -> Surface {
    let (u, v) = (spot.uv.x, spot.uv.y);
    let rib = step(0.06, 0.02, v.abs()) + 0.5 * step(0.16, 0.04, ((9.0 * (u - 0.55 * v.abs())).sin()).abs());
    let tone =
        0.78 + 0.3 * unit(spot.seed) + 0.25 * (fractal(Vec3::new(3.0 * u, 3.0 * v, unit(spot.seed) * 50.0), 3) - 0.5);
    let color = (spot.tint * tone).lerp(hex(0xb9cf8a), 0.25 * rib.min(1.0));
    Surface { wrap: 0.5, emission: 0.015 * color, ..Surface::matt(spot, color) }.glossy(0.07, 18.0)
}

/// A small picture under glass: hills and a sun.
pub fn landscape(spot: &Spot) -> Surface {
    let (u, v) = (spot.uv.x, spot.uv.y);
    if u.abs() > 0.72 || v.abs() > 0.76 {
        return Surface::matt(spot, hex(0xece4d4));
    }
    let hill = |height: f32, wave: f32, at: f32| step(0.0, 0.03, height + 0.16 * (wave * u + at).sin() - v);
    let sky = hex(0xe9b48a).lerp(hex(0x7fa0ad), 0.5 + 0.6 * v);
    let sun = step(0.17, 0.14, ((u - 0.25).powi(2) + (v - 0.25).powi(2)).sqrt());
    let color = sky.lerp(hex(0xf8e7b0), sun);
    let color = color.lerp(hex(0x6f8f86), hill(0.0, 3.1, 0.4)).lerp(hex(0x3f6660), hill(-0.25, 4.0, 2.0));
    Surface::matt(spot, color.lerp(hex(0x284743), hill(-0.5, 3.0, 4.2)))
}
