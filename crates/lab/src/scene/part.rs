//! Rigid parts of a scene: shapes, materials and motion.

use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::bvh::Bvh;
use super::grid::DistanceGrid;
use super::ray::Pose;
use super::shape::Shape;

/// A surface point to be shaded, in the frame of its part.
#[derive(Clone, Copy, Debug)]
pub struct ShadingPoint {
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
    pub specular: f32,
    /// Exponent of the highlight's lobe.
    pub shininess: f32,
    /// How far light wraps around the edge of shadow, 0 (hard) to 1 (skin, leaves, cloth).
    pub wrap: f32,
    /// Ambient light that reaches the point, 0 to 1, in addition to the occlusion by the part's own form.
    pub ambient_visibility: f32,
    /// Direction of a fibre, which is shaded as a thread; zero for surfaces.
    pub fibre: Vec3,
}

impl Surface {
    /// Creates a diffuse (matt) surface of the given reflectance.
    pub fn diffuse(point: &ShadingPoint, albedo: Vec3) -> Self {
        Self {
            albedo,
            emission: Vec3::ZERO,
            normal: point.normal,
            specular: 0.0,
            shininess: 1.0,
            wrap: 0.0,
            ambient_visibility: 1.0,
            fibre: Vec3::ZERO,
        }
    }

    pub fn with_highlight(self, specular: f32, shininess: f32) -> Self {
        Self { specular, shininess, ..self }
    }
}

/// Computes the surface at a point.
pub type SurfaceShader = fn(&ShadingPoint) -> Surface;

/// A surface shader with colour and seed.
#[derive(Clone, Copy, Debug)]
pub struct Material {
    pub shader: SurfaceShader,
    pub tint: Vec3,
    /// Distinguishes objects with the same shader.
    pub seed: u32,
}

impl Material {
    /// Creates a material of one colour.
    pub fn new(shader: SurfaceShader, tint: Vec3) -> Self {
        Self { shader, tint, seed: 0 }
    }

    /// Returns the material with another seed.
    pub fn with_seed(self, seed: u32) -> Self {
        Self { seed, ..self }
    }
}

/// A rigid group of shapes.
#[derive(Clone, Debug)]
pub struct Part {
    pub shapes: Vec<Shape>,
    /// The material of each shape.
    pub materials: Vec<Material>,
    /// The tree over the shapes, built by [`Part::with_bvh`].
    pub bvh: Bvh,
    /// The pose at a phase (0..1) of the loop.
    pub motion: fn(f32) -> Pose,
    /// Distances to the approximate form, for self-occlusion.
    pub distance_grid: Option<Arc<DistanceGrid>>,
    /// Whether it belongs to the person.
    pub is_subject: bool,
    /// Balls (centre, radius in metres) that shade other parts.
    pub occluders: Vec<(Vec3, f32)>,
}

impl Part {
    /// Creates a static part without shapes.
    pub fn new_static() -> Self {
        Self::new_moving(|_| Pose::IDENTITY)
    }

    /// Creates a moving part without shapes.
    pub fn new_moving(motion: fn(f32) -> Pose) -> Self {
        Self {
            shapes: Vec::new(),
            materials: Vec::new(),
            bvh: Bvh::default(),
            motion,
            distance_grid: None,
            is_subject: false,
            occluders: Vec::new(),
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
    pub fn with_bvh(mut self) -> Self {
        self.bvh = Bvh::new(&self.shapes);
        self
    }
}
