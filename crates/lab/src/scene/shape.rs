//! The primitives: where a ray meets them, and what the surface is like there.

use std::sync::Arc;

use glam::{Mat3, Vec2, Vec3};

use super::grid::{Distance, Grid};
use super::ray::{Bounds, Ray};

/// A closed or open surface.
#[derive(Clone, Debug)]
pub enum Shape {
    /// The parallelogram `centre + u * right + v * up` for `u`, `v` in -1..1, where `cut` (u, v) holds.
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
    /// A stretched ball: the points that `to_unit * (p - centre)` puts on the unit sphere.
    Ellipsoid {
        centre: Vec3,
        /// Shrinks the surface to the unit sphere.
        to_unit: Mat3,
    },
    /// A box, turned by `axes` (whose columns are the box's directions).
    Cuboid {
        centre: Vec3,
        axes: Mat3,
        /// Half the edges in metres.
        half: Vec3,
    },
    /// Two balls and the cone that touches both: a hair, a twig.
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
        /// Middle of the lower rim.
        base: Vec3,
        height: f32,
        /// Radius of the lower rim.
        low_radius: f32,
        /// Radius of the upper rim.
        high_radius: f32,
    },
    /// The zero set of a distance function inside a box.
    Field {
        distance: Distance,
        /// Where it is looked for.
        bounds: Bounds,
        /// Distances nowhere larger than the function's, to a cell: the way to the surface is walked through them.
        guide: Arc<Grid>,
    },
}

/// Outline of a [`Shape::Quad`] that fills its parallelogram.
pub fn whole(_: Vec2) -> bool {
    true
}

/// A field counts as met this near its surface, in metres.
const FIELD_TOLERANCE_M: f32 = 2e-5;
/// Steps before a grazing ray is taken to miss a field.
const FIELD_STEPS: u32 = 160;

impl Shape {
    /// An ellipsoid of half axes `radii` (metres) along the columns of the rotation `axes`.
    pub fn ellipsoid(centre: Vec3, axes: Mat3, radii: Vec3) -> Shape {
        Shape::Ellipsoid { centre, to_unit: Mat3::from_diagonal(radii.recip()) * axes.transpose() }
    }

    /// A box around the shape.
    pub fn bounds(&self) -> Bounds {
        match *self {
            Shape::Quad { centre, right, up, .. } => Bounds::around(centre, right.abs() + up.abs() + Vec3::splat(1e-4)),
            Shape::Sphere { centre, radius } => Bounds::around(centre, Vec3::splat(radius)),
            Shape::Ellipsoid { centre, to_unit } => {
                let m = to_unit.inverse().transpose();
                Bounds::around(centre, Vec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length()))
            }
            Shape::Cuboid { centre, axes, half } => Bounds::around(
                centre,
                axes.x_axis.abs() * half.x + axes.y_axis.abs() * half.y + axes.z_axis.abs() * half.z,
            ),
            Shape::Cone { a, b, radius_a, radius_b } => {
                Bounds::around(a, Vec3::splat(radius_a)).join(Bounds::around(b, Vec3::splat(radius_b)))
            }
            Shape::Frustum { base, height, low_radius, high_radius } => {
                let radius = low_radius.max(high_radius);
                Bounds { low: base - Vec3::new(radius, 0.0, radius), high: base + Vec3::new(radius, height, radius) }
            }
            Shape::Field { bounds, .. } => bounds,
        }
    }

    /// The first `t` in `0..t_max` at which the ray meets the surface from outside (from either side for open
    /// shapes).
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<f32> {
        let t = match *self {
            Shape::Quad { centre, right, up, cut } => intersect_quad(ray, centre, right, up, cut)?,
            Shape::Sphere { centre, radius } => {
                let (p, along_m) = ray.near(centre);
                let h = radius * radius - (p - centre).length_squared();
                if h < 0.0 {
                    return None;
                }
                (along_m - h.sqrt()) / ray.length
            }
            Shape::Ellipsoid { centre, to_unit } => {
                let (p, along_m) = ray.near(centre);
                let (o, d) = (to_unit * (p - centre), to_unit * ray.unit);
                let (a, b) = (d.length_squared(), o.dot(d));
                // The distance of the line from the middle by its own foot point keeps the precision.
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

    /// The outward unit normal at the surface's point `p`, and surface coordinates: `u`, `v` in -1..1 for a quad, the
    /// way along (0..1) for a cone, angle and height (0..1) for a frustum, else zero.
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
                // Seen from the axis the side leans by the difference of the radii.
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
                // Half the way between the samples, in metres: finer than any feature of a form.
                let e = 2e-4;
                // Four corners of a cube give the gradient with the fewest evaluations.
                let corners =
                    [Vec3::new(1.0, -1.0, -1.0), Vec3::new(-1.0, -1.0, 1.0), Vec3::new(-1.0, 1.0, -1.0), Vec3::ONE];
                plain(corners.into_iter().map(|k| k * distance(p + e * k)).sum())
            }
        }
    }
}

/// Normal and coordinates of a surface at one of its points.
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

/// The slab test in the box's own axes.
fn intersect_cuboid(ray: &Ray, centre: Vec3, axes: Mat3, half: Vec3) -> Option<f32> {
    let inverse = (axes.transpose() * ray.direction).recip();
    let middle = (axes.transpose() * (centre - ray.origin)) * inverse;
    let reach = half * inverse.abs();
    let (enter, leave) = ((middle - reach).max_element(), (middle + reach).min_element());
    (enter <= leave && enter > 0.0).then_some(enter)
}

/// Metres along the ray to a cone with round ends (I. Quilez's rounded cone): first its side, then the two balls.
fn intersect_cone(ray: &Ray, a: Vec3, b: Vec3, radius_a: f32, radius_b: f32) -> Option<f32> {
    let (origin, along_m) = ray.near(0.5 * (a + b));
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
    // Where along the axis the side is met: the balls take over beyond both rims.
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

/// The first of the two points on the infinite cone that lies between the rims; the inside counts as well.
fn intersect_frustum(ray: &Ray, base: Vec3, height: f32, low_radius: f32, high_radius: f32) -> Option<f32> {
    let (start, along_m) = ray.near(base + 0.5 * height * Vec3::Y);
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

/// Sphere tracing: in steps of the distance, by the guide as long as it is safely away from the surface, which saves
/// computing the distance function.
fn intersect_field(ray: &Ray, distance: Distance, bounds: &Bounds, guide: &Grid, t_max: f32) -> Option<f32> {
    let (mut t, leave) = bounds.span(ray, t_max)?;
    for _ in 0..FIELD_STEPS {
        let p = ray.at(t);
        let safe_m = guide.gap_m(p) - guide.cell_m();
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
