//! Rigid parts of a scene: shapes, materials and motion.

use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::bvh::Bvh;
use super::grid::Grid;
use super::ray::Pose;
use super::shape::Shape;

/// A surface point to be painted, in the frame of its part.
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    /// Position in metres.
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

/// The optical properties of a surface point.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Diffuse reflectance, linear, 0 to 1.
    pub albedo: Vec3,
    /// Emitted radiance, linear, 1 = white.
    pub emission: Vec3,
    /// Unit normal, possibly bump-mapped.
    pub normal: Vec3,
    /// Strength of the highlight.
    pub gloss: f32,
    /// Exponent of the highlight's lobe.
    pub shine: f32,
    /// How far light wraps around the edge of shadow, 0 (hard) to 1 (skin, leaves, cloth).
    pub wrap: f32,
    /// Ambient light that reaches the point, 0 to 1, in addition to the occlusion by the part's own form.
    pub open: f32,
    /// Direction of a fibre, which is shaded as a thread; zero for surfaces.
    pub fibre: Vec3,
}

impl Surface {
    /// Creates a matt surface of the given reflectance.
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

/// Computes the surface of a spot.
pub type Paint = fn(&Spot) -> Surface;

/// A paint with colour and seed.
#[derive(Clone, Copy, Debug)]
pub struct Material {
    pub paint: Paint,
    pub tint: Vec3,
    /// Distinguishes objects with the same paint.
    pub seed: u32,
}

impl Material {
    /// Creates a material of one colour.
    pub fn new(paint: Paint, tint: Vec3) -> Self {
        Self { paint, tint, seed: 0 }
    }

    /// Returns the material with another seed.
    pub fn seeded(self, seed: u32) -> Self {
        Self { seed, ..self }
    }
}

/// A rigid group of shapes.
#[derive(Clone, Debug)]
pub struct Part {
    pub shapes: Vec<Shape>,
    /// The material of each shape.
    pub materials: Vec<Material>,
    /// The tree over the shapes, built by [`Part::built`].
    pub tree: Bvh,
    /// The pose at a phase (0..1) of the loop.
    pub motion: fn(f32) -> Pose,
    /// The approximate form, for self-occlusion.
    pub form: Option<Arc<Grid>>,
    /// Whether it belongs to the person.
    pub is_subject: bool,
    /// Balls (centre, radius in metres) that shade other parts.
    pub shades: Vec<(Vec3, f32)>,
}

impl Part {
    /// Creates a static part without shapes.
    pub fn still() -> Self {
        Self::moving(|_| Pose::REST)
    }

    /// Creates a moving part without shapes.
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

    /// Returns the part with its tree.
    pub fn built(mut self) -> Self {
        self.tree = Bvh::new(&self.shapes);
        self
    }
}
