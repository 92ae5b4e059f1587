//! A small ray caster with a moving portrait, for the synthetic camera, the bundled recordings, and as the ground truth
//! of the blur.
//!
//! The world is in metres, `x` right, `y` up, `z` away from the camera; the left camera is at the origin and looks
//! along `z`. A pixel's ray has the direction `((column - cx) / focal_px, -(row - cy) / focal_px, 1)` with `cx = (width
//! - 1) / 2`, `cy = (height - 1) / 2`, so its parameter is the depth.

mod bvh;
mod grid;
mod light;
mod noise;
mod part;
mod portrait;
mod ray;
mod render;
mod shape;
mod targets;

pub use portrait::Situation;
pub use render::{LensPicture, LinearImage, ThinLens, View};
pub use targets::PointLight;

use glam::Vec3;
use light::{Ambient, Light, LitPoint, Occluder, SelfOccluder};
use part::{Part, ShadingPoint};
use ray::{BoundingBox, Pose, Ray};

/// A lit scene whose motion repeats after [`Scene::period_s`].
#[derive(Clone, Debug)]
pub struct Scene {
    parts: Vec<Part>,
    lights: Vec<Light>,
    ambient: Ambient,
    /// Radiance of rays that hit nothing.
    background: Vec3,
    focus_m: f32,
    period_s: f64,
}

impl Scene {
    /// Returns a person at a table in a room in the evening: subject in focus at 1.2 m, a twig in front at half a
    /// metre; behind, furniture, a shelf and a window to a lit street.
    pub fn portrait() -> Scene {
        portrait::create_portrait()
    }

    /// Returns the portrait without objects in front of the person, as a webcam sees most people.
    pub fn seated_person() -> Scene {
        Self::in_situation(Situation::Sits)
    }

    /// Returns a person in a situation.
    pub fn in_situation(situation: Situation) -> Scene {
        portrait::create_scene(Some(situation), situation)
    }

    /// Returns the room of a situation without the person.
    pub fn empty_room(situation: Situation) -> Scene {
        portrait::create_scene(None, situation)
    }

    /// Returns the length of the seamless loop, in seconds.
    pub fn period_s(&self) -> f64 {
        self.period_s
    }

    /// Returns the depth of the subject's face, in metres.
    pub fn focus_m(&self) -> f32 {
        self.focus_m
    }

    /// Returns the scene at `time_s`.
    fn pose_at(&self, time_s: f64) -> PosedScene<'_> {
        let phase = (time_s / self.period_s).rem_euclid(1.0) as f32;
        let poses: Vec<Pose> = self.parts.iter().map(|part| (part.motion)(phase)).collect();
        let occluders = self
            .parts
            .iter()
            .zip(&poses)
            .enumerate()
            .flat_map(|(index, (part, pose))| {
                part.occluders.iter().map(move |(centre, radius)| Occluder {
                    centre: pose.to_world(*centre),
                    radius: *radius,
                    part: index,
                })
            })
            .collect();
        let boxes = self.parts.iter().zip(&poses).map(|(part, pose)| part.bvh.bounds().transformed(pose)).collect();
        PosedScene { scene: self, poses, boxes, occluders }
    }
}

/// A scene at one point in time.
struct PosedScene<'a> {
    scene: &'a Scene,
    poses: Vec<Pose>,
    /// Bounding box of each part, in world coordinates.
    boxes: Vec<BoundingBox>,
    occluders: Vec<Occluder>,
}

/// The first hit of a ray.
#[derive(Clone, Copy)]
struct Hit {
    t: f32,
    part: usize,
    shape: usize,
}

impl PosedScene<'_> {
    /// Returns the nearest hit along the ray.
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let mut hit: Option<Hit> = None;
        for (part, (group, pose)) in self.scene.parts.iter().zip(&self.poses).enumerate() {
            let t_max = hit.map_or(f32::INFINITY, |h| h.t);
            if self.boxes[part].intersect_ray(ray, t_max).is_none() {
                continue;
            }
            let found = group.bvh.intersect(&group.shapes, &pose.ray_to_local(ray), t_max);
            if let Some((t, shape)) = found {
                hit = Some(Hit { t, part, shape: shape as usize });
            }
        }
        hit
    }

    /// Returns the linear radiance along the ray, and the depth of its origin.
    fn trace_ray(&self, ray: &Ray) -> (Vec3, f32) {
        match self.intersect(ray) {
            Some(hit) => (self.radiance(ray, hit), hit.t),
            None => (self.scene.background, 0.0),
        }
    }

    /// Returns the linear radiance of the surface at `hit` towards the ray's origin. Shading uses world coordinates;
    /// paint and the part's own form use the part's frame.
    fn radiance(&self, ray: &Ray, hit: Hit) -> Vec3 {
        let (part, pose) = (&self.scene.parts[hit.part], &self.poses[hit.part]);
        let (shape, material) = (&part.shapes[hit.shape], &part.materials[hit.shape]);
        let p = ray.at(hit.t);
        let local = pose.to_local(p);
        let mut point = shape.surface(local);
        // Open shapes are visible from both sides.
        if (pose.rotation * point.normal).dot(ray.unit) > 0.0 {
            point.normal = -point.normal;
        }
        let shading_point = ShadingPoint {
            p: local,
            normal: point.normal,
            uv: point.uv,
            tangent: point.tangent,
            tint: material.tint,
            seed: material.seed,
        };
        let mut surface = (material.shader)(&shading_point);
        // A surface without reflection needs no shadows.
        if surface.albedo == Vec3::ZERO && surface.specular <= 0.0 {
            return surface.emission;
        }
        surface.normal = pose.rotation * surface.normal;
        surface.fibre = pose.rotation * surface.fibre;
        let lit = LitPoint { p, to_eye: -ray.unit, surface, part: hit.part, occluders: &self.occluders };
        let to_local = |direction: Vec3| pose.rotation.transpose() * direction;
        let self_occluder = part.distance_grid.as_deref().map(|grid| SelfOccluder {
            grid,
            to_local: &to_local,
            p: local,
            normal: point.normal,
        });
        light::shade_point(&lit, &self.scene.lights, &self.scene.ambient, self_occluder)
    }
}
