//! Bare scenes with analytically known pictures, for measuring a lens.

use glam::Vec3;

use super::Scene;
use super::light::Ambient;
use super::noise;
use super::part::{Material, Part, ShadingPoint, Surface};
use super::shape::{Shape, keep_whole};

/// A small luminous ball.
#[derive(Clone, Copy, Debug)]
pub struct PointLight {
    /// Centre in metres (x right, y up, z away from the camera).
    pub centre_m: Vec3,
    /// Radius, in metres.
    pub radius_m: f32,
    /// Linear radiance, 1 = white.
    pub radiance: Vec3,
}

impl Scene {
    /// Returns static luminous balls in the dark.
    pub fn point_lights(lights: &[PointLight]) -> Scene {
        let mut part = Part::new_static();
        for light in lights {
            let shape = Shape::Sphere { centre: light.centre_m, radius: light.radius_m };
            part.add(shape, Material::new(shade_emissive, light.radiance));
        }
        dark_scene(part, lights.first().map_or(1.0, |light| light.centre_m.z))
    }

    /// Returns a mottled, luminous wall that faces the camera and fills every view narrower than 120 degrees.
    pub fn mottled_wall(depth_m: f32) -> Scene {
        let mut part = Part::new_static();
        let size_m = 2.0 * depth_m;
        let shape =
            Shape::Quad { centre: depth_m * Vec3::Z, right: size_m * Vec3::X, up: size_m * Vec3::Y, cut: keep_whole };
        part.add(shape, Material::new(shade_mottle, Vec3::ONE));
        dark_scene(part, depth_m)
    }
}

/// Creates a scene of one self-luminous part without lights.
fn dark_scene(part: Part, focus_m: f32) -> Scene {
    Scene {
        parts: vec![part.with_bvh()],
        lights: Vec::new(),
        ambient: Ambient { above: Vec3::ZERO, below: Vec3::ZERO },
        background: Vec3::ZERO,
        focus_m,
        period_s: 1.0,
    }
}

fn shade_emissive(point: &ShadingPoint) -> Surface {
    Surface { emission: point.tint, ..Surface::diffuse(point, Vec3::ZERO) }
}

fn shade_mottle(point: &ShadingPoint) -> Surface {
    // A function of direction, so that the mottles have the same size in the picture at every depth.
    let p = 25.0 * point.p / point.p.z.max(1e-3);
    let radiance =
        Vec3::new(noise::fractal_noise(p, 3), noise::fractal_noise(p + 7.0, 3), noise::fractal_noise(p + 13.0, 3));
    Surface { emission: 0.1 + 0.8 * radiance, ..Surface::diffuse(point, Vec3::ZERO) }
}
