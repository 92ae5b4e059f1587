//! Lighting: a few lamps, ambient light, and their occlusion.
//!
//! Everything here is a smooth function of the point (soft shadows come from distances, not from random rays), so
//! pictures have no noise even with few rays.

use glam::Vec3;

use super::grid::DistanceGrid;
use super::part::Surface;

#[derive(Clone, Copy, Debug)]
pub struct Light {
    /// Position in metres.
    pub position: Vec3,
    /// Radiance of a white surface at 1 m that faces it (linear, 1 = white).
    pub power: Vec3,
    /// Radius of the lamp over its distance: the softness of its shadows.
    pub softness: f32,
    /// Parts cast shadows on themselves only if the light is nearer than this, in metres.
    pub self_shadow_range_m: f32,
}

/// Ambient light, by the direction that a surface faces.
#[derive(Clone, Copy, Debug)]
pub struct Ambient {
    pub above: Vec3,
    pub below: Vec3,
}

/// A ball that occludes light, in world coordinates.
#[derive(Clone, Copy, Debug)]
pub struct Occluder {
    pub centre: Vec3,
    pub radius: f32,
    /// The part that it represents, whose own points it does not occlude.
    pub part: usize,
}

/// A point to be lit.
#[derive(Clone, Copy, Debug)]
pub struct LitPoint<'a> {
    /// The point in the world, in metres.
    pub p: Vec3,
    /// Unit vector to the camera.
    pub to_eye: Vec3,
    /// The surface, with its directions in world coordinates.
    pub surface: Surface,
    /// The part that it belongs to.
    pub part: usize,
    pub occluders: &'a [Occluder],
}

/// A part's form and a point in its frame, for self-occlusion.
#[derive(Clone, Copy)]
pub struct SelfOccluder<'a> {
    /// Distances to the form.
    pub grid: &'a DistanceGrid,
    /// Rotates a world direction into the part's frame.
    pub to_local: &'a dyn Fn(Vec3) -> Vec3,
    /// The point in the part's frame.
    pub p: Vec3,
    /// The unit normal of the form there, without bump mapping.
    pub normal: Vec3,
}

/// Light that contributes less than this (1 = white) gets no shadow, as it would be invisible.
const MIN_SHADOWED_RADIANCE: f32 = 0.03;
/// Balls farther away than this do not occlude, in metres.
const MAX_OCCLUDER_DISTANCE_M: f32 = 0.7;

/// Returns the radiance from the point to the camera: reflected lamps and ambient light, plus emission. `self_occluder` is the form
/// of its part, for self-occlusion.
pub fn shade_point(lit: &LitPoint, lights: &[Light], ambient: &Ambient, self_occluder: Option<SelfOccluder>) -> Vec3 {
    let surface = &lit.surface;
    let near = |s: &Occluder| {
        s.part != lit.part && s.centre.distance_squared(lit.p) < MAX_OCCLUDER_DISTANCE_M * MAX_OCCLUDER_DISTANCE_M
    };
    let shaded = lit.occluders.iter().any(near);
    let mut visibility = surface.ambient_visibility * self_occluder.map_or(1.0, |f| self_ambient_visibility(&f));
    if shaded {
        visibility *= occluders_ambient_visibility(lit);
    }
    let up = 0.5 + 0.5 * surface.normal.y;
    let mut diffuse = (ambient.below + (ambient.above - ambient.below) * up) * visibility;
    let mut highlight = Vec3::ZERO;
    for light in lights {
        let to_light = light.position - lit.p;
        let distance_m = to_light.length();
        let direction = to_light / distance_m;
        // No brighter than at 10 cm.
        let strength = light.power / (distance_m * distance_m).max(0.01);
        let (lambert, lobe) = reflection(surface, direction, lit.to_eye);
        if (lambert + lobe) * strength.max_element() <= 0.0 {
            continue;
        }
        // Cavities of the paint, which the geometry lacks, also hide part of each lamp.
        let mut seen = 0.4 + 0.6 * surface.ambient_visibility;
        if lambert.max(lobe) * strength.max_element() > MIN_SHADOWED_RADIANCE {
            if shaded {
                seen *= occluders_visibility(lit, direction, distance_m, light.softness);
            }
            if let (true, Some(f)) = (distance_m < light.self_shadow_range_m && seen > 0.01, self_occluder) {
                seen *= self_visibility(&f, (f.to_local)(direction), distance_m, light.softness);
            }
        }
        diffuse += strength * (lambert * seen);
        highlight += strength * (lobe * seen);
    }
    surface.albedo * diffuse + highlight + surface.emission
}

/// Returns the fractions of a lamp's light reflected to the camera: diffuse, and in the highlight (Blinn-Phong).
fn reflection(surface: &Surface, to_light: Vec3, to_eye: Vec3) -> (f32, f32) {
    let half = (to_light + to_eye).normalize_or_zero();
    let facing = surface.normal.dot(to_light);
    if surface.fibre != Vec3::ZERO {
        // Hair after Kajiya and Kay 1989: bright across the fibre, dark along it.
        let across = |v: Vec3| (1.0 - surface.fibre.dot(v).powi(2)).max(0.0).sqrt();
        let around = ((facing + 0.6) / 1.6).clamp(0.0, 1.0);
        return (across(to_light) * around, surface.specular * across(half).powf(surface.shininess) * around);
    }
    let lambert = ((facing + surface.wrap) / (1.0 + surface.wrap)).max(0.0);
    if surface.specular <= 0.0 || facing <= 0.0 {
        return (lambert, 0.0);
    }
    let lobe = surface.normal.dot(half).max(0.0).powf(surface.shininess);
    // Stronger at grazing angles, like Fresnel reflection; fades in where the surface begins to face the lamp.
    let edge = 1.0 + 3.0 * (1.0 - half.dot(to_eye).max(0.0)).powi(5);
    (lambert, surface.specular * lobe * edge * facing.min(0.25) * 4.0)
}

/// Returns how open the part's own form leaves the surroundings, 0 to 1: ambient occlusion from how much smaller the
/// distances along the normal are than the distances travelled.
fn self_ambient_visibility(self_occluder: &SelfOccluder) -> f32 {
    // Distances along the normal in cells, and weights. They start at 1.5, as the grid has no detail finer than a cell.
    let taps = [(1.5, 1.0), (4.0, 0.7), (10.0, 0.45), (24.0, 0.28)]
        .map(|(n, weight)| (n * self_occluder.grid.cell_m(), weight));
    let (mut hidden, mut total) = (0.0, 0.0);
    for (range_m, weight) in taps {
        let gap_m = self_occluder.grid.distance_m(self_occluder.p + range_m * self_occluder.normal);
        hidden += weight * (1.0 - (gap_m / range_m).clamp(0.0, 1.0));
        total += weight;
    }
    (1.0 - 1.15 * hidden / total).max(0.0)
}

/// Returns the visible fraction of a lamp past the part's own form, 0 to 1 (soft shadows after I. Quilez).
fn self_visibility(self_occluder: &SelfOccluder, direction: Vec3, distance_m: f32, softness: f32) -> f32 {
    let range_m = distance_m.min(1.2);
    let cell_m = self_occluder.grid.cell_m();
    let start = self_occluder.p + 0.7 * cell_m * self_occluder.normal;
    let (mut seen, mut along_m) = (1.0f32, 1.2 * cell_m);
    for _ in 0..12 {
        let gap_m = self_occluder.grid.distance_m(start + along_m * direction);
        seen = seen.min(0.5 + 0.5 * gap_m / (softness * along_m));
        if seen <= 0.0 {
            return 0.0;
        }
        along_m += gap_m.clamp(1.5 * cell_m, 0.4);
        if along_m > range_m {
            break;
        }
    }
    smoothstep(seen)
}

/// Returns the visible fraction of a lamp past the [`Occluder`]s of other parts, 0 to 1.
fn occluders_visibility(lit: &LitPoint, direction: Vec3, distance_m: f32, softness: f32) -> f32 {
    let mut seen = 1.0;
    for occluder in lit.occluders.iter().filter(|s| s.part != lit.part) {
        let to_occluder = occluder.centre - lit.p;
        let along_m = to_occluder.dot(direction);
        if along_m <= 0.0 || along_m >= distance_m {
            continue;
        }
        let gap_m = (to_occluder.length_squared() - along_m * along_m).max(0.0).sqrt() - occluder.radius;
        seen *= smoothstep((0.5 + 0.5 * gap_m / (softness * along_m + 1e-3)).clamp(0.0, 1.0));
    }
    seen
}

/// Returns how open the [`Occluder`]s of other parts leave the surroundings, 0 to 1.
fn occluders_ambient_visibility(lit: &LitPoint) -> f32 {
    let mut visibility = 1.0;
    for occluder in lit.occluders.iter().filter(|s| s.part != lit.part) {
        let to_occluder = occluder.centre - lit.p;
        let distance_m = to_occluder.length().max(occluder.radius);
        let angle = occluder.radius / distance_m;
        visibility *= 1.0 - 0.8 * (lit.surface.normal.dot(to_occluder) / distance_m).max(0.0) * angle * angle;
    }
    visibility
}

/// Returns the smoothstep of `x` in 0..1.
fn smoothstep(x: f32) -> f32 {
    x * x * (3.0 - 2.0 * x)
}
