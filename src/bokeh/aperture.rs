//! The shape of the lens opening, sampled as an antialiased mask.

mod outline;

use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};
use std::path::PathBuf;
use std::sync::Arc;

use outline::Outline;

/// A lens opening inside the unit disc, drawn as a far highlight shows it (x right, y down).
#[derive(Clone, Debug, PartialEq)]
pub struct Aperture {
    /// The outline.
    pub shape: Shape,
    /// Radial intensity: -1 a soap bubble (bright rim), 0 flat, 1 apodised (bright centre).
    pub intensity: f32,
}

/// The outline of an aperture.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A circle.
    Disc,
    /// A circle with a hole (mirror lens).
    Ring {
        /// Radius of the hole, 0 to below 1.
        inner: f32,
    },
    /// A regular polygon of straight or curved blades.
    Polygon {
        /// Number of blades, 3 to 16.
        blades: u32,
        /// Turn clockwise in degrees; at 0 one corner points to the left.
        rotation_deg: f32,
        /// 0 straight blades to 1 a circle.
        curvature: f32,
    },
    /// A heart.
    Heart,
    /// A star with one point up.
    Star {
        /// Number of points, 3 to 16.
        points: u32,
    },
    /// A greyscale picture; its larger side spans the disc's diameter.
    Picture(Arc<Picture>),
}

/// A greyscale picture used as an aperture.
#[derive(Debug, PartialEq)]
pub struct Picture {
    /// File it was read from, if known.
    pub file: Option<PathBuf>,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `height * width` transmittances, 0 to 1, row-major.
    pub grey: Vec<f32>,
}

/// A square mask of transmittances, at least one of them above 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    /// Columns and rows.
    pub size: usize,
    /// Half the side of the square, in aperture radii: a soft rim extends beyond 1.
    pub extent: f64,
    /// `size * size` values >= 0, row-major, y down.
    pub values: Vec<f64>,
}

/// Samples per mask cell and axis.
const SUPERSAMPLING: usize = 8;

impl Default for Aperture {
    fn default() -> Self {
        Self { shape: Shape::Disc, intensity: 0.0 }
    }
}

impl Aperture {
    /// Returns the antialiased mask of `size` x `size` cells. Its rim falls linearly over `rim` (0 to 1) of the radius,
    /// half inside and half outside the outline.
    pub fn to_mask(&self, size: usize, rim: f32) -> Mask {
        let rim = f64::from(rim).clamp(0.0, 1.0);
        let extent = 1.0 + rim / 2.0;
        let cell = 2.0 * extent / size as f64;
        let sub = cell / SUPERSAMPLING as f64;
        let outline = Outline::new(&self.shape);
        let mut values = vec![0.0; size * size];
        for (index, value) in values.iter_mut().enumerate() {
            let (left, top) = ((index % size) as f64 * cell - extent, (index / size) as f64 * cell - extent);
            let middle = (left + cell / 2.0).hypot(top + cell / 2.0);
            if let Some(uniform) = self.clear_of_rim(&outline, middle, cell * FRAC_1_SQRT_2, rim) {
                *value = uniform;
                continue;
            }
            for sample in 0..SUPERSAMPLING * SUPERSAMPLING {
                let x = left + (0.5 + (sample % SUPERSAMPLING) as f64) * sub;
                let y = top + (0.5 + (sample / SUPERSAMPLING) as f64) * sub;
                *value += self.transmittance(&outline, x, y, rim);
            }
            *value /= (SUPERSAMPLING * SUPERSAMPLING) as f64;
        }
        if values.iter().all(|&v| v <= 0.0) {
            // A black picture or a vanishing ring transmits no light; a pinhole is the nearest useful aperture.
            values[size / 2 * size + size / 2] = 1.0;
        }
        Mask { size, extent, values }
    }

    /// Returns the transmittance of all points within `around` of a point at `radius`, if they are clear of the rim in
    /// every direction, as most are.
    fn clear_of_rim(&self, outline: &Outline, radius: f64, around: f64, rim: f64) -> Option<f64> {
        let [min, max] = outline.range;
        match self.shape {
            Shape::Picture(_) => None,
            _ if radius - around > max + rim / 2.0 => Some(0.0),
            Shape::Ring { .. } => None,
            _ if self.intensity == 0.0 && radius + around < min - rim / 2.0 => Some(1.0),
            _ => None,
        }
    }

    /// Returns the transmittance, 0 to 1, at a point in units of the aperture's radius, with a soft edge of width
    /// `rim`.
    fn transmittance(&self, outline: &Outline, x: f64, y: f64, rim: f64) -> f64 {
        let radius = (x * x + y * y).sqrt();
        if let Shape::Picture(picture) = &self.shape {
            return picture.sample(x, y, rim) * self.radial_intensity(radius.min(1.0));
        }
        if let Some(value) = self.clear_of_rim(outline, radius, 0.0, rim) {
            return value;
        }
        let edge = outline.radius_towards(x, y);
        let mut value = ramp(radius, edge, rim) * self.radial_intensity((radius / edge).min(1.0));
        if let Shape::Ring { inner } = self.shape
            && inner > 0.0
        {
            // A rim wider than the hole would close it.
            value *= 1.0 - ramp(radius, f64::from(inner), rim.min(f64::from(inner)));
        }
        value
    }

    /// Returns the radial intensity at `t` = 0 (centre) to 1 (outline). Even a full soap bubble keeps 15 % in its
    /// centre.
    fn radial_intensity(&self, t: f64) -> f64 {
        let strength = f64::from(self.intensity).clamp(-1.0, 1.0);
        if strength >= 0.0 { 1.0 - strength * t * t } else { 1.0 + strength * (1.0 - t.powi(4)) * 0.85 }
    }
}

impl Picture {
    /// Returns the transmittance at a point in units of the aperture's radius: the mean over a square of side `rim`,
    /// which softens the picture. Outside the picture it is 0.
    fn sample(&self, x: f64, y: f64, rim: f64) -> f64 {
        const TAPS: i32 = 3;
        let half_px = f64::from(self.width.max(self.height)) / 2.0;
        let mut sum = 0.0;
        for j in 0..TAPS * TAPS {
            let (dx, dy) = (f64::from(j % TAPS - 1) / 3.0 * rim, f64::from(j / TAPS - 1) / 3.0 * rim);
            let column = ((x + dx) * half_px + f64::from(self.width) / 2.0).floor();
            let row = ((y + dy) * half_px + f64::from(self.height) / 2.0).floor();
            if column >= 0.0 && row >= 0.0 && column < f64::from(self.width) && row < f64::from(self.height) {
                sum += f64::from(self.grey[row as usize * self.width as usize + column as usize].max(0.0));
            }
        }
        sum / f64::from(TAPS * TAPS)
    }
}

/// Returns 1 inside `edge`, 0 outside, linear over `rim` around it.
fn ramp(radius: f64, edge: f64, rim: f64) -> f64 {
    if rim <= 0.0 { f64::from(u8::from(radius <= edge)) } else { ((edge - radius) / rim + 0.5).clamp(0.0, 1.0) }
}

impl Mask {
    /// Whether the mask is unchanged by a mirror image left to right, and top to bottom.
    pub fn symmetry(&self) -> (bool, bool) {
        let n = self.size;
        let at = |x: usize, y: usize| self.values[y * n + x];
        let same = |a: f64, b: f64| (a - b).abs() < 1e-9;
        let cells = || (0..n * n).map(move |i| (i % n, i / n));
        (cells().all(|(x, y)| same(at(x, y), at(n - 1 - x, y))), cells().all(|(x, y)| same(at(x, y), at(x, n - 1 - y))))
    }

    /// Whether the middle, a quarter of the area, lets through less than half of what the brightest part does: a shape that
    /// a coarse grid does not keep.
    pub fn is_hollow(&self) -> bool {
        let (quarter, n) = (self.size / 4, self.size);
        let middle = (quarter..n - quarter).flat_map(|y| &self.values[y * n + quarter..(y + 1) * n - quarter]);
        let brightest = self.values.iter().copied().fold(0.0, f64::max);
        middle.sum::<f64>() < 0.5 * brightest * ((n - 2 * quarter) * (n - 2 * quarter)) as f64
    }

    /// Returns the sum of all values.
    pub fn sum(&self) -> f64 {
        self.values.iter().sum()
    }
}

/// Returns points of the aperture for a ray tracer: about `count` lens positions `u` in the unit disc, evenly spread
/// over the shape (Vogel's spiral without the points outside). A pixel `p` sees depth `z` at `p + c(z) u`, so that a
/// far highlight shows the shape upright.
pub fn lens_points(aperture: &Aperture, count: usize) -> Vec<glam::DVec2> {
    let golden_angle = PI * (3.0 - 5f64.sqrt());
    let outline = Outline::new(&aperture.shape);
    let open = |p: &glam::DVec2| aperture.transmittance(&outline, p.x, p.y, 0.0) > 0.5;
    let spiral = |n: usize| {
        (0..n).map(move |k| {
            let radius = ((k as f64 + 0.5) / n as f64).sqrt();
            glam::DVec2::from_angle((k as f64 * golden_angle) % TAU) * radius
        })
    };
    // Fraction of the disc that is open: the spiral must be denser by its inverse to leave `count` points.
    let open_fraction = spiral(4096).filter(open).count().max(1) as f64 / 4096.0;
    // Negated: the blur of a far point is the aperture turned by 180 degrees.
    spiral((count as f64 / open_fraction).round() as usize).filter(open).map(|p| -p).collect()
}

#[cfg(test)]
mod tests {
    use super::outline::STAR_INNER;
    use super::*;

    fn of(shape: Shape) -> Aperture {
        Aperture { shape, intensity: 0.0 }
    }

    #[test]
    fn areas_are_those_of_the_shapes() {
        let polygon = |n: u32| 0.5 * f64::from(n) * (TAU / f64::from(n)).sin();
        for (shape, area) in [
            (Shape::Disc, PI),
            (Shape::Ring { inner: 0.5 }, 0.75 * PI),
            (Shape::Polygon { blades: 5, rotation_deg: 13.0, curvature: 0.0 }, polygon(5)),
            (Shape::Polygon { blades: 6, rotation_deg: 0.0, curvature: 0.0 }, polygon(6)),
            (Shape::Polygon { blades: 7, rotation_deg: 0.0, curvature: 1.0 }, PI),
            (Shape::Star { points: 5 }, 5.0 * STAR_INNER * (PI / 5.0).sin()),
        ] {
            let mask = of(shape.clone()).to_mask(128, 0.0);
            let measured = mask.sum() * (2.0 / 128f64).powi(2);
            assert!((measured - area).abs() < 0.004 * area, "{shape:?}: {measured} against {area}");
        }
    }

    #[test]
    fn a_soft_rim_keeps_the_disc_in_its_second_moment() {
        let (hard, soft) = (of(Shape::Disc).to_mask(128, 0.0), of(Shape::Disc).to_mask(128, 0.2));
        let spread = |m: &Mask| {
            let at = |i: usize| (i as f64 + 0.5) / 64.0 - 1.0;
            let sum: f64 = m.values.iter().enumerate().map(|(k, v)| v * at(k % 128).powi(2)).sum();
            sum / m.sum() * m.extent * m.extent
        };
        assert!((spread(&hard) - 0.25).abs() < 1e-3);
        assert!((spread(&soft) / spread(&hard) - 1.0).abs() < 0.02);
    }

    #[test]
    fn symmetry_and_orientation() {
        assert_eq!(of(Shape::Disc).to_mask(32, 0.2).symmetry(), (true, true));
        assert_eq!(of(Shape::Heart).to_mask(32, 0.0).symmetry(), (true, false));
        let mask = of(Shape::Heart).to_mask(64, 0.0);
        let rows = |r: std::ops::Range<usize>| mask.values[r.start * 64..r.end * 64].iter().sum::<f64>();
        assert!(rows(0..32) > 1.2 * rows(32..64), "a heart is wider above");
        let picture = Picture { file: None, width: 2, height: 1, grey: vec![1.0, 0.0] };
        let mask = of(Shape::Picture(Arc::new(picture))).to_mask(64, 0.0);
        assert!(mask.values[32 * 64 + 10] > 0.9 && mask.values[32 * 64 + 54] == 0.0);
    }

    #[test]
    fn a_black_picture_is_a_pinhole() {
        let black =
            of(Shape::Picture(Arc::new(Picture { file: None, width: 1, height: 1, grey: vec![0.0] }))).to_mask(16, 0.1);
        assert_eq!(black.sum(), 1.0);
    }

    #[test]
    fn intensity_moves_light_to_the_rim_or_the_centre() {
        let centre_over_rim = |intensity: f32| {
            let mask = Aperture { shape: Shape::Disc, intensity }.to_mask(64, 0.0);
            mask.values[32 * 64 + 32] / mask.values[32 * 64 + 4]
        };
        assert!(centre_over_rim(1.0) > 3.0 && centre_over_rim(-1.0) < 0.5);
    }

    #[test]
    fn lens_points_fill_the_shape() {
        let points = lens_points(&of(Shape::Polygon { blades: 6, rotation_deg: 0.0, curvature: 0.0 }), 500);
        assert!((450..550).contains(&points.len()));
        let mean: glam::DVec2 = points.iter().sum::<glam::DVec2>() / points.len() as f64;
        assert!(mean.length() < 0.02);
    }
}
