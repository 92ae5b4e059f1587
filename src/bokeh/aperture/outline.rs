//! The outline of an aperture: its distance from the centre, by direction.

use std::f64::consts::{PI, TAU};

use super::Shape;

/// Directions at which the outline of a shape with corners is tabulated, with linear interpolation. At the rim a step
/// is smaller than a sample of a mask.
const DIRECTIONS: usize = 8192;
/// Ratio of a star's inner to its outer radius.
pub(super) const STAR_INNER: f64 = 0.45;

/// The tabulated outline of a shape.
pub(super) struct Outline {
    /// Radii by direction, clockwise from -x, with the first repeated at the end; two values for a circle.
    radii: Vec<f64>,
    /// Smallest and largest radius.
    pub range: [f64; 2],
}

impl Outline {
    /// Tabulates the outline of a shape, in units of the aperture's radius.
    pub fn new(shape: &Shape) -> Self {
        let steps = match shape {
            Shape::Disc | Shape::Ring { .. } | Shape::Picture(_) => 1,
            Shape::Polygon { .. } | Shape::Heart | Shape::Star { .. } => DIRECTIONS,
        };
        let radii: Vec<f64> = (0..=steps).map(|k| outline_radius(shape, k as f64 / steps as f64 * TAU - PI)).collect();
        let (least, most) = radii.iter().fold((f64::INFINITY, 0.0f64), |(low, high), &r| (low.min(r), high.max(r)));
        Self { radii, range: [least, most] }
    }

    /// Returns the distance of the outline from the centre in the direction of a point, y down.
    #[inline]
    pub fn radius_towards(&self, x: f64, y: f64) -> f64 {
        if self.range[0] == self.range[1] {
            return self.range[0];
        }
        let last = self.radii.len() - 1;
        let at = (y.atan2(x) + PI) / TAU * last as f64;
        let index = (at as usize).min(last - 1);
        let fraction = at - index as f64;
        self.radii[index] * (1.0 - fraction) + self.radii[index + 1] * fraction
    }
}

/// Returns the distance of the outline from the centre in the direction `angle` (radians, clockwise from +x as y is
/// down).
fn outline_radius(shape: &Shape, angle: f64) -> f64 {
    match *shape {
        Shape::Disc | Shape::Ring { .. } | Shape::Picture(_) => 1.0,
        Shape::Polygon { blades, rotation_deg, curvature } => {
            let (half, bend) = (PI / f64::from(blades.max(3)), f64::from(curvature).clamp(0.0, 1.0));
            let from_corner = (angle - PI - f64::from(rotation_deg).to_radians()).rem_euclid(2.0 * half);
            // Polar form of the straight edge between two corners, bent towards the circle.
            half.cos() / (from_corner - half).cos() * (1.0 - bend) + bend
        }
        Shape::Heart => heart_radius(angle),
        Shape::Star { points } => {
            let half = PI / f64::from(points.max(3));
            let from_tip = ((angle + PI / 2.0 + half).rem_euclid(2.0 * half) - half).abs();
            // Edge from the tip (1, 0) to the notch at angle `half`, intersected with the ray at `from_tip`.
            let (notch_x, notch_y) = (STAR_INNER * half.cos(), STAR_INNER * half.sin());
            notch_y / (from_tip.sin() * (1.0 - notch_x) + from_tip.cos() * notch_y)
        }
    }
}

/// Returns the radius of the heart (x^2 + y^2 - 1)^3 = x^2 y^3 in direction `angle`, upright for y down and scaled to
/// fit the square from -1 to 1; found by bisection. Never 0, so that callers may divide by it.
fn heart_radius(angle: f64) -> f64 {
    const SCALE: f64 = 1.0 / 1.25;
    let (sin, cos) = (-(angle.sin()), angle.cos());
    let inside = |r: f64| {
        let (x, y) = (r * cos, r * sin);
        (x * x + y * y - 1.0).powi(3) <= x * x * y.powi(3)
    };
    // Its farthest points are 1.42 from the centre.
    let (mut low, mut high) = (0.0, 1.6);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if inside(middle) { low = middle } else { high = middle }
    }
    (low * SCALE).max(1e-3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_the_outline() {
        let polygon = Shape::Polygon { blades: 5, rotation_deg: 13.0, curvature: 0.1 };
        for shape in [Shape::Disc, Shape::Heart, Shape::Star { points: 5 }, polygon] {
            let outline = Outline::new(&shape);
            let apart = |k: usize| {
                let angle = (k as f64 + 0.37) / 10_000.0 * TAU - PI;
                (outline.radius_towards(angle.cos(), angle.sin()) - outline_radius(&shape, angle)).abs()
            };
            let errors: Vec<f64> = (0..10_000).map(apart).collect();
            let (worst, mean) = (errors.iter().copied().fold(0.0, f64::max), errors.iter().sum::<f64>() / 1e4);
            // At a corner, or at the notch of the heart, a few directions are off by less than a sample of a mask.
            assert!(worst < 5e-3 && mean < 5e-6, "{shape:?}: {worst} {mean}");
        }
    }
}
