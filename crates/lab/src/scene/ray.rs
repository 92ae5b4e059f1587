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
    pub fn near(&self, p: Vec3) -> (Vec3, f32) {
        let along_m = (p - self.origin).dot(self.unit);
        (self.origin + along_m * self.unit, along_m)
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// The corner with the lowest coordinates.
    pub low: Vec3,
    /// The corner with the highest coordinates.
    pub high: Vec3,
}

impl Bounds {
    /// The empty box.
    pub const EMPTY: Bounds = Bounds { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };

    /// Creates the box around `centre` with half its size.
    pub fn around(centre: Vec3, half: Vec3) -> Self {
        Self { low: centre - half, high: centre + half }
    }

    /// Returns the smallest box that contains both.
    pub fn join(self, other: Bounds) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    pub fn centre(&self) -> Vec3 {
        0.5 * (self.low + self.high)
    }

    /// Returns a bounding box of the box in `pose`.
    pub fn posed(&self, pose: &Pose) -> Self {
        let (half, turn) = (0.5 * (self.high - self.low), pose.turn);
        let half_extent = turn.x_axis.abs() * half.x + turn.y_axis.abs() * half.y + turn.z_axis.abs() * half.z;
        Self::around(pose.to_world(self.centre()), half_extent)
    }

    /// Returns half the surface area, to which the probability of a hit is proportional.
    pub fn half_area(&self) -> f32 {
        let d = (self.high - self.low).max(Vec3::ZERO);
        d.x * d.y + d.y * d.z + d.z * d.x
    }

    /// Returns the interval of the ray inside the box, clipped to `0..t_max`; `None` if it is empty.
    pub fn span(&self, ray: &Ray, t_max: f32) -> Option<(f32, f32)> {
        let a = (self.low - ray.origin) * ray.inverse;
        let b = (self.high - ray.origin) * ray.inverse;
        let enter = a.min(b).max_element().max(0.0);
        let leave = a.max(b).min_element().min(t_max);
        (enter <= leave).then_some((enter, leave))
    }
}

/// The pose of a part: `world = turn * local + place`.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    pub turn: Mat3,
    /// Position of the part's origin, in metres.
    pub place: Vec3,
}

impl Pose {
    /// The identity.
    pub const REST: Pose = Pose { turn: Mat3::IDENTITY, place: Vec3::ZERO };

    /// Returns the composition: `inner` first, then `self`.
    pub fn over(self, inner: Pose) -> Pose {
        Pose { turn: self.turn * inner.turn, place: self.turn * inner.place + self.place }
    }

    /// Creates a rotation around the point `pivot`.
    pub fn about(pivot: Vec3, turn: Mat3) -> Pose {
        Pose { turn, place: pivot - turn * pivot }
    }

    /// Converts a world point to the part's frame.
    pub fn to_local(self, p: Vec3) -> Vec3 {
        self.turn.transpose() * (p - self.place)
    }

    /// Converts a point of the part's frame to world coordinates.
    pub fn to_world(self, p: Vec3) -> Vec3 {
        self.turn * p + self.place
    }

    /// Converts the ray to the part's frame; `t` keeps its meaning.
    pub fn ray_to_local(&self, ray: &Ray) -> Ray {
        Ray::new(self.to_local(ray.origin), self.turn.transpose() * ray.direction)
    }
}
