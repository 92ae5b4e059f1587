//! Light: a few lamps, light from all around, and what is in their way.
//!
//! Everything here is a smooth function of the point (soft shadows come from distances, not from random rays), so
//! pictures have no grain, however few rays they are made of.

use glam::Vec3;

use super::grid::Grid;
use super::part::Surface;

#[derive(Clone, Copy, Debug)]
pub struct Light {
    /// Where it is, in metres.
    pub position: Vec3,
    /// What a white surface 1 m away, facing it, shines with (linear, 1 = white).
    pub power: Vec3,
    /// Radius of the lamp over its distance: how soft its shadows are.
    pub softness: f32,
    /// Parts cast shadows on themselves only if the light is nearer than this, in metres.
    pub casts_within_m: f32,
}

/// Light from all around, by the direction that a surface faces.
#[derive(Clone, Copy, Debug)]
pub struct Ambient {
    pub above: Vec3,
    pub below: Vec3,
}

/// A ball in the way of light, in the world.
#[derive(Clone, Copy, Debug)]
pub struct Shade {
    pub centre: Vec3,
    pub radius: f32,
    /// The part that it stands for: it does not shade that one.
    pub part: usize,
}

/// A point to be lit.
#[derive(Clone, Copy, Debug)]
pub struct Lit<'a> {
    /// The point in the world, in metres.
    pub p: Vec3,
    /// Unit vector to the eye.
    pub to_eye: Vec3,
    /// The surface, its directions in the world.
    pub surface: Surface,
    /// The part that it belongs to.
    pub part: usize,
    pub shades: &'a [Shade],
}

/// A part's form and the point in its frame, for what the part hides from itself.
#[derive(Clone, Copy)]
pub struct Form<'a> {
    /// Distances from the form.
    pub grid: &'a Grid,
    /// A world direction in the part's frame.
    pub to_local: &'a dyn Fn(Vec3) -> Vec3,
    /// The point in the part's frame.
    pub p: Vec3,
    /// The unit normal of the form there, before roughening.
    pub normal: Vec3,
}

/// Light that contributes less than this (1 = white) gets no shadow: it would not be seen.
const FAINT: f32 = 0.03;
/// Balls further away than this shade nothing, in metres.
const SHADE_REACH_M: f32 = 0.7;

/// The radiance that the point sends to the eye: reflected lamps and ambient light, and its own emission. `form` is
/// that of its part, which hides light from itself.
pub fn shine(lit: &Lit, lights: &[Light], ambient: &Ambient, form: Option<Form>) -> Vec3 {
    let surface = &lit.surface;
    let near = |s: &Shade| s.part != lit.part && s.centre.distance_squared(lit.p) < SHADE_REACH_M * SHADE_REACH_M;
    let shaded = lit.shades.iter().any(near);
    let mut open = surface.open * form.map_or(1.0, |f| openness(&f));
    if shaded {
        open *= shades_openness(lit);
    }
    let up = 0.5 + 0.5 * surface.normal.y;
    let mut diffuse = (ambient.below + (ambient.above - ambient.below) * up) * open;
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
        // Cavities that only the paint knows of hide some of each lamp, too.
        let mut seen = 0.4 + 0.6 * surface.open;
        if lambert.max(lobe) * strength.max_element() > FAINT {
            if shaded {
                seen *= shades_visibility(lit, direction, distance_m, light.softness);
            }
            if let (true, Some(f)) = (distance_m < light.casts_within_m && seen > 0.01, form) {
                seen *= form_visibility(&f, (f.to_local)(direction), distance_m, light.softness);
            }
        }
        diffuse += strength * (lambert * seen);
        highlight += strength * (lobe * seen);
    }
    surface.albedo * diffuse + highlight + surface.emission
}

/// The shares of a lamp's light that are reflected to the eye diffusely, and in the highlight (Blinn and Phong's).
fn reflection(surface: &Surface, to_light: Vec3, to_eye: Vec3) -> (f32, f32) {
    let half = (to_light + to_eye).normalize_or_zero();
    let facing = surface.normal.dot(to_light);
    if surface.fibre != Vec3::ZERO {
        // Kajiya and Kay's model of hair: bright across the fibre, dark along.
        let across = |v: Vec3| (1.0 - surface.fibre.dot(v).powi(2)).max(0.0).sqrt();
        let around = ((facing + 0.6) / 1.6).clamp(0.0, 1.0);
        return (across(to_light) * around, surface.gloss * across(half).powf(surface.shine) * around);
    }
    let lambert = ((facing + surface.wrap) / (1.0 + surface.wrap)).max(0.0);
    if surface.gloss <= 0.0 || facing <= 0.0 {
        return (lambert, 0.0);
    }
    let lobe = surface.normal.dot(half).max(0.0).powf(surface.shine);
    // Stronger at grazing angles, as by Fresnel; it fades in where the surface begins to face the lamp.
    let edge = 1.0 + 3.0 * (1.0 - half.dot(to_eye).max(0.0)).powi(5);
    (lambert, surface.gloss * lobe * edge * facing.min(0.25) * 4.0)
}

/// How much of the surroundings the part's own form leaves open, 0 to 1: ambient occlusion by how much smaller the
/// distances along the normal are than the way there.
fn openness(form: &Form) -> f32 {
    // Cells along the normal, and weights. The grid has no detail finer than a cell: they start at one and a half.
    let taps = [(1.5, 1.0), (4.0, 0.7), (10.0, 0.45), (24.0, 0.28)].map(|(n, weight)| (n * form.grid.cell_m(), weight));
    let (mut hidden, mut total) = (0.0, 0.0);
    for (reach_m, weight) in taps {
        let gap_m = form.grid.gap_m(form.p + reach_m * form.normal);
        hidden += weight * (1.0 - (gap_m / reach_m).clamp(0.0, 1.0));
        total += weight;
    }
    (1.0 - 1.15 * hidden / total).max(0.0)
}

/// The share of a lamp that is seen past the part's own form, 0 to 1, after Quilez's soft shadows.
fn form_visibility(form: &Form, direction: Vec3, distance_m: f32, softness: f32) -> f32 {
    let reach_m = distance_m.min(1.2);
    let cell_m = form.grid.cell_m();
    let start = form.p + 0.7 * cell_m * form.normal;
    let (mut seen, mut along_m) = (1.0f32, 1.2 * cell_m);
    for _ in 0..12 {
        let gap_m = form.grid.gap_m(start + along_m * direction);
        seen = seen.min(0.5 + 0.5 * gap_m / (softness * along_m));
        if seen <= 0.0 {
            return 0.0;
        }
        along_m += gap_m.clamp(1.5 * cell_m, 0.4);
        if along_m > reach_m {
            break;
        }
    }
    smooth(seen)
}

/// The share of a lamp that is seen past the [`Shade`]s of other parts, 0 to 1.
fn shades_visibility(lit: &Lit, direction: Vec3, distance_m: f32, softness: f32) -> f32 {
    let mut seen = 1.0;
    for shade in lit.shades.iter().filter(|s| s.part != lit.part) {
        let to_shade = shade.centre - lit.p;
        let along_m = to_shade.dot(direction);
        if along_m <= 0.0 || along_m >= distance_m {
            continue;
        }
        let gap_m = (to_shade.length_squared() - along_m * along_m).max(0.0).sqrt() - shade.radius;
        seen *= smooth((0.5 + 0.5 * gap_m / (softness * along_m + 1e-3)).clamp(0.0, 1.0));
    }
    seen
}

/// How much of the surroundings the [`Shade`]s of other parts leave open, 0 to 1.
fn shades_openness(lit: &Lit) -> f32 {
    let mut open = 1.0;
    for shade in lit.shades.iter().filter(|s| s.part != lit.part) {
        let to_shade = shade.centre - lit.p;
        let distance_m = to_shade.length().max(shade.radius);
        let angle = shade.radius / distance_m;
        open *= 1.0 - 0.8 * (lit.surface.normal.dot(to_shade) / distance_m).max(0.0) * angle * angle;
    }
    open
}

/// The smoothstep of `x` in 0..1.
fn smooth(x: f32) -> f32 {
    x * x * (3.0 - 2.0 * x)
}
