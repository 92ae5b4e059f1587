//! Projection of points in space to pixels, and back to rays.
//!
//! Radial-tangential: D. C. Brown, *Decentering distortion of lenses*, 1966, with OpenCV's rational terms; thin prism
//! and tilted sensor: the equations in the documentation of OpenCV's module calib3d.
//! Equidistant: J. Kannala, S. Brandt, *A generic camera model and calibration method*, PAMI 28 (2006), eq. 6.

use glam::{DMat2, DMat3, DVec2, DVec3};

use super::{CameraIntrinsics, Distortion};

/// Largest angle of a ray to the axis: a flat picture of wider ones would be unbounded.
const MAX_ANGLE_DEG: f64 = 80.0;
/// Step of the angle at which [`Distortion::max_radius`] samples the model.
const STEP_DEG: f64 = 0.1;

impl Distortion {
    /// Returns the coefficients of the model.
    pub fn coefficients(&self) -> &[f64] {
        match self {
            Self::RadialTangential(coefficients) => coefficients,
            Self::PrismTilted(coefficients) => coefficients,
            Self::Equidistant(coefficients) => coefficients,
        }
    }

    /// Returns whether it distorts nothing.
    pub fn is_none(&self) -> bool {
        !matches!(self, Self::Equidistant(_)) && self.coefficients().iter().all(|&coefficient| coefficient == 0.0)
    }

    /// Returns the distorted distance from the axis for the undistorted distance `radius`, both on the plane at
    /// distance 1, without the tangential part.
    fn distort_radius(&self, radius: f64) -> f64 {
        match *self {
            Self::RadialTangential([k1, k2, _, _, k3, k4, k5, k6])
            | Self::PrismTilted([k1, k2, _, _, k3, k4, k5, k6, ..]) => {
                let r2 = radius * radius;
                radius * (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
            }
            Self::Equidistant([k1, k2, k3, k4]) => {
                let angle = radius.atan();
                let a2 = angle * angle;
                angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))))
            }
        }
    }

    /// Returns the distorted position of the undistorted `point`, both on the plane at distance 1.
    pub fn distort(&self, point: DVec2) -> DVec2 {
        let r2 = point.length_squared();
        let radius = r2.sqrt();
        let distorted = if radius > 0.0 { point * (self.distort_radius(radius) / radius) } else { point };
        let (p1, p2) = match *self {
            Self::RadialTangential([_, _, p1, p2, ..]) | Self::PrismTilted([_, _, p1, p2, ..]) => (p1, p2),
            Self::Equidistant(_) => return distorted,
        };
        let cross = 2.0 * point.x * point.y;
        let across = p1 * cross + p2 * (r2 + 2.0 * point.x * point.x);
        let down = p1 * (r2 + 2.0 * point.y * point.y) + p2 * cross;
        let decentered = distorted + DVec2::new(across, down);
        let Self::PrismTilted([.., s1, s2, s3, s4, tilt_x_rad, tilt_y_rad]) = *self else { return decentered };
        let prism = DVec2::new(r2 * (s1 + r2 * s2), r2 * (s3 + r2 * s4));
        tilt_sensor(decentered + prism, tilt_x_rad, tilt_y_rad)
    }

    /// Returns the largest distance from the axis up to which the model is one-to-one, on the plane at distance 1:
    /// polynomials turn back beyond the rays that they were fitted to. At most that of 80 degrees.
    pub fn max_radius(&self) -> f64 {
        let radius = |step: u32| (f64::from(step) * STEP_DEG).to_radians().tan();
        let last = (MAX_ANGLE_DEG / STEP_DEG) as u32;
        let spreads = |step: &u32| self.distort_radius(radius(step + 1)) > self.distort_radius(radius(*step));
        radius((0..last).find(|step| !spreads(step)).unwrap_or(last))
    }

    /// Inverts [`Distortion::distort`]. Points beyond `max_radius` are clamped to it.
    fn undistort(&self, point: DVec2, max_radius: f64) -> DVec2 {
        let length = point.length();
        if length == 0.0 && self.distort(point) == point {
            return point;
        }
        if length >= self.distort_radius(max_radius) {
            return point * (max_radius / length);
        }
        // The radial part by bisection, which always converges, to a billionth of the maximum; the small tangential
        // part by Newton's method.
        let (mut near, mut far) = (0.0, max_radius);
        for _ in 0..30 {
            let middle = (near + far) / 2.0;
            if self.distort_radius(middle) < length { near = middle } else { far = middle }
        }
        let mut guess = if length > 0.0 { point * (near / length) } else { point };
        const DELTA: f64 = 1e-6;
        for _ in 0..8 {
            let slope = |step: DVec2| (self.distort(guess + step) - self.distort(guess - step)) / (2.0 * DELTA);
            let slopes = DMat2::from_cols(slope(DVec2::X * DELTA), slope(DVec2::Y * DELTA));
            let next = guess + slopes.inverse() * (point - self.distort(guess));
            // A longer step leaves the neighbourhood in which the method converges.
            let step = next.distance(guess);
            if !next.is_finite() || step > 0.1 {
                break;
            }
            guess = next;
            if step < 1e-15 {
                break;
            }
        }
        guess
    }
}

/// Returns where the ray through `point`, on the plane at distance 1, meets the tilted sensor, seen along the sensor's
/// own axis.
fn tilt_sensor(point: DVec2, tilt_x_rad: f64, tilt_y_rad: f64) -> DVec2 {
    let turn = DMat3::from_rotation_y(-tilt_y_rad) * DMat3::from_rotation_x(-tilt_x_rad);
    let turned = turn * point.extend(1.0);
    let axis = turn.z_axis;
    (axis.z * turned.truncate() - axis.truncate() * turned.z) / turned.z
}

impl CameraIntrinsics {
    /// Returns the pixel that sees `point` in the camera's axes (x right, y down, z forward), also outside the picture;
    /// `None` behind the camera and beyond the lens's `max_radius`.
    pub fn project(&self, point: DVec3, max_radius: f64) -> Option<DVec2> {
        let flat = point.truncate() / point.z;
        let is_seen = point.z > 0.0 && flat.length_squared() <= max_radius * max_radius;
        is_seen.then(|| self.distortion.distort(flat) * self.focal_px + self.center_px)
    }

    /// Returns the ray of a pixel, on the plane at distance 1, clamped to `max_radius`.
    pub fn unproject(&self, pixel_px: DVec2, max_radius: f64) -> DVec2 {
        self.distortion.undistort((pixel_px - self.center_px) / self.focal_px, max_radius)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENSES: [Distortion; 5] = [
        Distortion::RadialTangential([-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0.0, 0.0, 0.0, 0.0]),
        Distortion::RadialTangential([-0.055, 0.078, 0.001, -0.002, -0.14, 0.0, 0.0, -0.141]),
        Distortion::RadialTangential([0.0; 8]),
        Distortion::Equidistant([0.0034, 0.0007, -0.0020, 0.0002]),
        Distortion::PrismTilted([-0.28, 0.07, 2e-4, 1e-5, 0.01, 0.0, 0.0, 0.0, 5e-4, -1e-4, 2e-4, 1e-4, 1e-3, -2e-3]),
    ];

    #[test]
    fn undistorting_is_distorting_backwards() {
        for lens in LENSES {
            let max_radius = lens.max_radius();
            for k in 0..200 {
                let (radius, angle) = (f64::from(k) / 200.0 * max_radius.min(1.0) * 0.95, f64::from(k) * 0.7);
                let point = DVec2::from_angle(angle) * radius;
                let back = lens.undistort(lens.distort(point), max_radius);
                assert!((back - point).length() < 1e-9, "{lens:?}: {point} became {back}");
            }
        }
    }

    #[test]
    fn the_reach_is_where_a_polynomial_turns_back() {
        // r - 0.3 r^3 grows up to 1 / sqrt(0.9).
        let barrel = Distortion::RadialTangential([-0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert!((barrel.max_radius() - 0.9_f64.powf(-0.5)).abs() < 0.01);
        assert!((Distortion::Equidistant([0.0; 4]).max_radius() - 80.0_f64.to_radians().tan()).abs() < 1e-9);
        let beyond = barrel.undistort(DVec2::new(3.0, 0.0), barrel.max_radius());
        assert_eq!(beyond, DVec2::new(barrel.max_radius(), 0.0));
    }

    #[test]
    fn nobody_sees_what_is_behind() {
        let camera = CameraIntrinsics {
            size: None,
            focal_px: DVec2::splat(100.0),
            center_px: DVec2::splat(50.0),
            distortion: LENSES[3],
        };
        assert_eq!(camera.project(DVec3::new(0.1, 0.0, -1.0), camera.distortion.max_radius()), None);
        assert_eq!(camera.project(DVec3::Z, camera.distortion.max_radius()), Some(camera.center_px));
    }
}
