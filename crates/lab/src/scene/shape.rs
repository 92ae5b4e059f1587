//! The primitives: ray intersections and surface properties.

use std::sync::Arc;

use glam::{Mat3, Vec2, Vec3};

use super::grid::{DistanceFn, DistanceGrid};
use super::ray::{BoundingBox, Ray};

/// A closed or open surface.
#[derive(Clone, Debug)]
pub enum Shape {
    /// The parallelogram `centre + u * right + v * up` for `u`, `v` in -1..1, restricted to `cut` (u, v).
    Quad {
        centre: Vec3,
        /// From the middle to the right edge.
        right: Vec3,
        /// From the middle to the upper edge.
        up: Vec3,
        /// The outline within the parallelogram.
        cut: fn(Vec2) -> bool,
    },
    Sphere {
        centre: Vec3,
        radius: f32,
    },
    /// An ellipsoid: the points that `to_unit * (p - centre)` maps to the unit sphere.
    Ellipsoid {
        centre: Vec3,
        /// Maps the surface to the unit sphere.
        to_unit: Mat3,
    },
    /// A box, rotated by `axes` (whose columns are the directions of its edges).
    Cuboid {
        centre: Vec3,
        axes: Mat3,
        /// Half the edges, in metres.
        half: Vec3,
    },
    /// Two balls and the cone tangent to both: a hair, a twig.
    Cone {
        a: Vec3,
        b: Vec3,
        /// Radius at `a`, in metres.
        radius_a: f32,
        /// Radius at `b`, in metres.
        radius_b: f32,
    },
    /// The side of an upright frustum without lids: a lamp shade, a pot.
    Frustum {
        /// Centre of the lower rim.
        base: Vec3,
        height: f32,
        /// Radius of the lower rim.
        low_radius: f32,
        /// Radius of the upper rim.
        high_radius: f32,
    },
    /// The zero set of a distance function inside a box.
    Field {
        distance: DistanceFn,
        /// The box to search.
        bounds: BoundingBox,
        /// A grid of the function, accurate to a cell: sphere tracing uses it away from the surface.
        guide: Arc<DistanceGrid>,
    },
}

/// The outline of a [`Shape::Quad`] that fills its parallelogram.
pub fn keep_whole(_: Vec2) -> bool {
    true
}

/// A field counts as hit at this distance from its surface, in metres.
const FIELD_TOLERANCE_M: f32 = 2e-5;
/// Maximum number of steps; a ray that needs more grazes the field and counts as a miss.
const FIELD_STEPS: u32 = 160;

impl Shape {
    /// Creates an ellipsoid with half axes `radii` (metres) along the columns of the rotation `axes`.
    pub fn ellipsoid(centre: Vec3, axes: Mat3, radii: Vec3) -> Shape {
        Shape::Ellipsoid { centre, to_unit: Mat3::from_diagonal(radii.recip()) * axes.transpose() }
    }

    /// Returns a bounding box of the shape.
    pub fn bounds(&self) -> BoundingBox {
        match *self {
            Shape::Quad { centre, right, up, .. } => {
                BoundingBox::from_center(centre, right.abs() + up.abs() + Vec3::splat(1e-4))
            }
            Shape::Sphere { centre, radius } => BoundingBox::from_center(centre, Vec3::splat(radius)),
            Shape::Ellipsoid { centre, to_unit } => {
                let m = to_unit.inverse().transpose();
                BoundingBox::from_center(centre, Vec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length()))
            }
            Shape::Cuboid { centre, axes, half } => BoundingBox::from_center(
                centre,
                axes.x_axis.abs() * half.x + axes.y_axis.abs() * half.y + axes.z_axis.abs() * half.z,
            ),
            Shape::Cone { a, b, radius_a, radius_b } => BoundingBox::from_center(a, Vec3::splat(radius_a))
                .union(BoundingBox::from_center(b, Vec3::splat(radius_b))),
            Shape::Frustum { base, height, low_radius, high_radius } => {
                let radius = low_radius.max(high_radius);
                BoundingBox {
                    low: base - Vec3::new(radius, 0.0, radius),
                    high: base + Vec3::new(radius, height, radius),
                }
            }
            Shape::Field { bounds, .. } => bounds,
        }
    }

    /// Returns the first `t` in `0..t_max` at which the ray meets the surface from outside (from either side for open
    /// shapes).
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<f32> {
        let t = match *self {
            Shape::Quad { centre, right, up, cut } => intersect_quad(ray, centre, right, up, cut)?,
            Shape::Sphere { centre, radius } => {
                let (p, along_m) = ray.closest_point(centre);
                let h = radius * radius - (p - centre).length_squared();
                if h < 0.0 {
                    return None;
                }
                (along_m - h.sqrt()) / ray.length
            }
            Shape::Ellipsoid { centre, to_unit } => {
                let (p, along_m) = ray.closest_point(centre);
                let (o, d) = (to_unit * (p - centre), to_unit * ray.unit);
                let (a, b) = (d.length_squared(), o.dot(d));
                // Computing the line's distance from the centre at its own foot point preserves precision.
                let h = 1.0 - (o - d * (b / a)).length_squared();
                if h < 0.0 {
                    return None;
                }
                (along_m - b / a - (h / a).sqrt()) / ray.length
            }
            Shape::Cuboid { centre, axes, half } => intersect_cuboid(ray, centre, axes, half)?,
            Shape::Cone { a, b, radius_a, radius_b } => intersect_cone(ray, a, b, radius_a, radius_b)? / ray.length,
            Shape::Frustum { base, height, low_radius, high_radius } => {
                intersect_frustum(ray, base, height, low_radius, high_radius)?
            }
            Shape::Field { distance, bounds, ref guide } => intersect_field(ray, distance, &bounds, guide, t_max)?,
        };
        (t > 0.0 && t < t_max).then_some(t)
    }

    /// Returns the outward unit normal at the surface point `p`, and surface coordinates: `u`, `v` in -1..1 for a quad,
    /// the position along (0..1) for a cone, angle and height (0..1) for a frustum, zero otherwise.
    pub fn surface(&self, p: Vec3) -> SurfacePoint {
        let plain = |normal: Vec3| SurfacePoint {
            normal: normal.normalize_or(Vec3::NEG_Z),
            uv: Vec2::ZERO,
            tangent: Vec3::ZERO,
        };
        match *self {
            Shape::Quad { centre, right, up, .. } => SurfacePoint {
                normal: right.cross(up).normalize_or(Vec3::NEG_Z),
                uv: quad_uv(p - centre, right, up),
                tangent: right.normalize_or(Vec3::X),
            },
            Shape::Sphere { centre, .. } => plain(p - centre),
            Shape::Ellipsoid { centre, to_unit } => plain(to_unit.transpose() * (to_unit * (p - centre))),
            Shape::Cuboid { centre, axes, half } => {
                let q = axes.transpose() * (p - centre) / half;
                let a = q.abs();
                let axis = if a.x >= a.y && a.x >= a.z {
                    Vec3::X
                } else if a.y >= a.z {
                    Vec3::Y
                } else {
                    Vec3::Z
                };
                plain(axes * (axis * q.signum()))
            }
            Shape::Cone { a, b, radius_a, radius_b } => {
                let ab = b - a;
                let along = ((p - a).dot(ab) / ab.length_squared()).clamp(0.0, 1.0);
                // The difference of the radii tilts the side relative to the axis.
                let normal = (p - a - along * ab).normalize_or(Vec3::NEG_Z) * ab.length()
                    + ab.normalize_or_zero() * (radius_a - radius_b);
                let tangent = ab.normalize_or(Vec3::Y);
                SurfacePoint { uv: Vec2::new(along, 0.0), tangent, ..plain(normal) }
            }
            Shape::Frustum { base, height, low_radius, high_radius } => {
                let q = p - base;
                let side = Vec3::new(q.x, 0.0, q.z).normalize_or(Vec3::X);
                let lean = (low_radius - high_radius) / height;
                SurfacePoint { uv: Vec2::new(q.z.atan2(q.x), q.y / height), ..plain(side + lean * Vec3::Y) }
            }
            Shape::Field { distance, .. } => {
                // Half the distance between the samples, in metres: finer than any feature of a form.
                let e = 2e-4;
                // Four corners of a cube give the gradient with the fewest evaluations.
                let corners =
                    [Vec3::new(1.0, -1.0, -1.0), Vec3::new(-1.0, -1.0, 1.0), Vec3::new(-1.0, 1.0, -1.0), Vec3::ONE];
                plain(corners.into_iter().map(|k| k * distance(p + e * k)).sum())
            }
        }
    }
}

/// Normal and coordinates of a surface point.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    pub normal: Vec3,
    pub uv: Vec2,
    /// Unit vector along a cone, or to the right of a quad.
    pub tangent: Vec3,
}

fn quad_uv(q: Vec3, right: Vec3, up: Vec3) -> Vec2 {
    Vec2::new(q.dot(right) / right.length_squared(), q.dot(up) / up.length_squared())
}

fn intersect_quad(ray: &Ray, centre: Vec3, right: Vec3, up: Vec3, cut: fn(Vec2) -> bool) -> Option<f32> {
    let normal = right.cross(up);
    let t = (centre - ray.origin).dot(normal) / ray.direction.dot(normal);
    let uv = quad_uv(ray.at(t) - centre, right, up);
    (t.is_finite() && uv.abs().max_element() <= 1.0 && cut(uv)).then_some(t)
}

/// Intersects a box with the slab method in its own axes.
fn intersect_cuboid(ray: &Ray, centre: Vec3, axes: Mat3, half: Vec3) -> Option<f32> {
    let inverse = (axes.transpose() * ray.direction).recip();
    let middle = (axes.transpose() * (centre - ray.origin)) * inverse;
    let half_extent = half * inverse.abs();
    let (enter, leave) = ((middle - half_extent).max_element(), (middle + half_extent).min_element());
    (enter <= leave && enter > 0.0).then_some(enter)
}

/// Returns metres along the ray to a cone with round ends (I. Quilez's rounded cone): first its side, then the two
/// balls.
fn intersect_cone(ray: &Ray, a: Vec3, b: Vec3, radius_a: f32, radius_b: f32) -> Option<f32> {
    let (origin, along_m) = ray.closest_point(0.5 * (a + b));
    let (ab, oa, ob, d) = (b - a, origin - a, origin - b, ray.unit);
    let shrink = radius_a - radius_b;
    let (m0, m1, m2, m3, m5) = (ab.length_squared(), ab.dot(oa), ab.dot(d), d.dot(oa), oa.length_squared());
    let side = m0 - shrink * shrink;
    let k2 = side - m2 * m2;
    let k1 = side * m3 - m1 * m2 + m2 * shrink * radius_a;
    let k0 = side * m5 - m1 * m1 + 2.0 * m1 * shrink * radius_a - m0 * radius_a * radius_a;
    let h = k1 * k1 - k0 * k2;
    if h < 0.0 {
        return None;
    }
    let t = (-h.sqrt() - k1) / k2;
    // Position of the hit along the axis: beyond the rims the balls take over.
    let y = m1 - radius_a * shrink + t * m2;
    if y > 0.0 && y < side {
        return Some(along_m + t);
    }
    let ball = |o: Vec3, radius: f32| {
        let b = d.dot(o);
        let h = radius * radius - (o - b * d).length_squared();
        if h < 0.0 { f32::INFINITY } else { -b - h.sqrt() }
    };
    let t = ball(oa, radius_a).min(ball(ob, radius_b));
    t.is_finite().then_some(along_m + t)
}

/// Returns the first of the two hits on the infinite cone between the rims; the inside counts as well.
fn intersect_frustum(ray: &Ray, base: Vec3, height: f32, low_radius: f32, high_radius: f32) -> Option<f32> {
    let (start, along_m) = ray.closest_point(base + 0.5 * height * Vec3::Y);
    let (o, d) = (start - base, ray.unit);
    let slope = (high_radius - low_radius) / height;
    let (radius, growth) = (low_radius + slope * o.y, slope * d.y);
    let a = d.x * d.x + d.z * d.z - growth * growth;
    let b = o.x * d.x + o.z * d.z - radius * growth;
    let c = o.x * o.x + o.z * o.z - radius * radius;
    let h = b * b - a * c;
    if h < 0.0 {
        return None;
    }
    [(-b - h.sqrt()) / a, (-b + h.sqrt()) / a]
        .into_iter()
        .filter(|t| (0.0..=height).contains(&(o.y + t * d.y)))
        .map(|t| (along_m + t) / ray.length)
        .find(|t| *t > 0.0)
}

/// Sphere tracing (Hart 1996): steps by the guide while it is safely away from the surface, which saves evaluations of
/// the distance function.
fn intersect_field(
    ray: &Ray,
    distance: DistanceFn,
    bounds: &BoundingBox,
    guide: &DistanceGrid,
    t_max: f32,
) -> Option<f32> {
    let (mut t, leave) = bounds.intersect_ray(ray, t_max)?;
    for _ in 0..FIELD_STEPS {
        let p = ray.at(t);
        let safe_m = guide.distance_m(p) - guide.cell_m();
        let gap_m = if safe_m > guide.cell_m() { safe_m } else { distance(p) };
        if gap_m < FIELD_TOLERANCE_M {
            return Some(t);
        }
        t += gap_m / ray.length;
        if t > leave {
            return None;
        }
    }
    None
}
