//! Rigid parts of a scene: shapes, what they are painted with, and how they move.

use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::bvh::Bvh;
use super::grid::Grid;
use super::ray::Pose;
use super::shape::Shape;

/// A point of a surface to be painted, in the frame of its part.
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    /// The point, in metres.
    pub p: Vec3,
    pub normal: Vec3,
    /// Surface coordinates of the shape.
    pub uv: Vec2,
    /// Unit vector along a cone, or to the right of a quad.
    pub tangent: Vec3,
    /// The material's colour, linear.
    pub tint: Vec3,
    pub seed: u32,
}

/// How a surface answers light, at one point.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Diffuse reflectance, linear, 0 to 1.
    pub albedo: Vec3,
    /// Radiance that it gives off by itself, linear, 1 = white.
    pub emission: Vec3,
    /// Unit normal, perhaps roughened.
    pub normal: Vec3,
    /// Strength of the highlight.
    pub gloss: f32,
    /// Sharpness of the highlight: the exponent of its lobe.
    pub shine: f32,
    /// How far light creeps around the edge of shadow, 0 (hard) to 1 (skin, leaves, cloth).
    pub wrap: f32,
    /// Light from all around that reaches the point, 0 to 1, on top of what the part's own form hides.
    pub open: f32,
    /// The direction of a fibre, which is lit as a thread rather than as a surface; zero for surfaces.
    pub fibre: Vec3,
}

impl Surface {
    /// A dull surface of the given reflectance at the spot.
    pub fn matt(spot: &Spot, albedo: Vec3) -> Self {
        Self {
            albedo,
            emission: Vec3::ZERO,
            normal: spot.normal,
            gloss: 0.0,
            shine: 1.0,
            wrap: 0.0,
            open: 1.0,
            fibre: Vec3::ZERO,
        }
    }

    pub fn glossy(self, gloss: f32, shine: f32) -> Self {
        Self { gloss, shine, ..self }
    }
}

/// Turns a spot into a surface.
pub type Paint = fn(&Spot) -> Surface;

/// A paint with its colour and seed.
#[derive(Clone, Copy, Debug)]
pub struct Material {
    pub paint: Paint,
    pub tint: Vec3,
    /// Sets apart things of the same paint.
    pub seed: u32,
}

impl Material {
    /// A paint of one colour.
    pub fn new(paint: Paint, tint: Vec3) -> Self {
        Self { paint, tint, seed: 0 }
    }

    /// The same paint with another seed.
    pub fn seeded(self, seed: u32) -> Self {
        Self { seed, ..self }
    }
}

/// A rigid group of shapes.
#[derive(Clone, Debug)]
pub struct Part {
    pub shapes: Vec<Shape>,
    /// The paint of each shape.
    pub materials: Vec<Material>,
    /// The tree over the shapes; made by [`Part::built`].
    pub tree: Bvh,
    /// Where the part stands at a phase (0..1) of the loop.
    pub motion: fn(f32) -> Pose,
    /// Roughly the part's form: what hides light from its own surfaces.
    pub form: Option<Arc<Grid>>,
    /// Whether it belongs to the person of a portrait.
    pub is_subject: bool,
    /// Balls (centre, radius in metres) that shade other parts.
    pub shades: Vec<(Vec3, f32)>,
}

impl Part {
    /// A part without shapes that stays where it is.
    pub fn still() -> Self {
        Self::moving(|_| Pose::REST)
    }

    /// A part without shapes that moves.
    pub fn moving(motion: fn(f32) -> Pose) -> Self {
        Self {
            shapes: Vec::new(),
            materials: Vec::new(),
            tree: Bvh::default(),
            motion,
            form: None,
            is_subject: false,
            shades: Vec::new(),
        }
    }

    pub fn add(&mut self, shape: Shape, material: Material) {
        self.shapes.push(shape);
        self.materials.push(material);
    }

    /// Adds a chain of cones through `points` (each with its radius in metres).
    pub fn add_chain(&mut self, points: &[(Vec3, f32)], material: Material) {
        for pair in points.windows(2) {
            let ((a, radius_a), (b, radius_b)) = (pair[0], pair[1]);
            self.add(Shape::Cone { a, b, radius_a, radius_b }, material);
        }
    }

    /// The part with its tree.
    pub fn built(mut self) -> Self {
        self.tree = Bvh::new(&self.shapes);
        self
    }
}
