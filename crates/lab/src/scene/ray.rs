//! Rays, bounding boxes, and rigid poses.

use glam::{Mat3, Vec3};

/// A half line `origin + t * direction`. For a camera ray `direction.z` is 1, so `t` is the depth in metres.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    pub origin: Vec3,
    /// Step per unit of `t`, of any length.
    pub direction: Vec3,
    /// `direction`, normalised.
    pub unit: Vec3,
    /// Length of `direction`.
    pub length: f32,
    /// Reciprocals of the components of `direction`.
    pub inverse: Vec3,
}

impl Ray {
    /// Creates the ray from `origin` along `direction`.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        let length = direction.length();
        Self { origin, direction, unit: direction / length, length, inverse: direction.recip() }
    }

    /// Returns the point at `t`.
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + t * self.direction
    }

    /// Returns the point of the ray nearest to `p`, and its distance along the ray in metres. Intersections are
    /// computed from there, because the square of a hair's radius would be lost in the rounding of a squared camera
    /// distance.
    pub fn closest_point(&self, p: Vec3) -> (Vec3, f32) {
        let along_m = (p - self.origin).dot(self.unit);
        (self.origin + along_m * self.unit, along_m)
    }
}

#[derive(Clone, Copy, Debug)]
pub struct BoundingBox {
    /// The corner with the lowest coordinates.
    pub low: Vec3,
    /// The corner with the highest coordinates.
    pub high: Vec3,
}

impl BoundingBox {
    /// The empty box.
    pub const EMPTY: BoundingBox = BoundingBox { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };

    /// Creates the box around `centre` with half its size.
    pub fn from_center(centre: Vec3, half: Vec3) -> Self {
        Self { low: centre - half, high: centre + half }
    }

    /// Returns the smallest box that contains both.
    pub fn union(self, other: BoundingBox) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    pub fn centre(&self) -> Vec3 {
        0.5 * (self.low + self.high)
    }

    /// Returns a bounding box of the box in `pose`.
    pub fn transformed(&self, pose: &Pose) -> Self {
        let (half, rotation) = (0.5 * (self.high - self.low), pose.rotation);
        let half_extent =
            rotation.x_axis.abs() * half.x + rotation.y_axis.abs() * half.y + rotation.z_axis.abs() * half.z;
        Self::from_center(pose.to_world(self.centre()), half_extent)
    }

    /// Returns half the surface area, to which the probability of a hit is proportional.
    pub fn half_area(&self) -> f32 {
        let d = (self.high - self.low).max(Vec3::ZERO);
        d.x * d.y + d.y * d.z + d.z * d.x
    }

    /// Returns the interval of the ray inside the box, clipped to `0..t_max`; `None` if it is empty.
    pub fn intersect_ray(&self, ray: &Ray, t_max: f32) -> Option<(f32, f32)> {
        let a = (self.low - ray.origin) * ray.inverse;
        let b = (self.high - ray.origin) * ray.inverse;
        let enter = a.min(b).max_element().max(0.0);
        let leave = a.max(b).min_element().min(t_max);
        (enter <= leave).then_some((enter, leave))
    }
}

/// The pose of a part: `world = rotation * local + translation`.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    pub rotation: Mat3,
    /// Position of the part's origin, in metres.
    pub translation: Vec3,
}

impl Pose {
    /// The identity.
    pub const IDENTITY: Pose = Pose { rotation: Mat3::IDENTITY, translation: Vec3::ZERO };

    /// Returns the composition: `inner` first, then `self`.
    pub fn compose(self, inner: Pose) -> Pose {
        Pose {
            rotation: self.rotation * inner.rotation,
            translation: self.rotation * inner.translation + self.translation,
        }
    }

    /// Creates a rotation around the point `pivot`.
    pub fn rotation_about(pivot: Vec3, rotation: Mat3) -> Pose {
        Pose { rotation, translation: pivot - rotation * pivot }
    }

    /// Converts a world point to the part's frame.
    pub fn to_local(self, p: Vec3) -> Vec3 {
        self.rotation.transpose() * (p - self.translation)
    }

    /// Converts a point of the part's frame to world coordinates.
    pub fn to_world(self, p: Vec3) -> Vec3 {
        self.rotation * p + self.translation
    }

    /// Converts the ray to the part's frame; `t` keeps its meaning.
    pub fn ray_to_local(&self, ray: &Ray) -> Ray {
        Ray::new(self.to_local(ray.origin), self.rotation.transpose() * ray.direction)
    }
}
