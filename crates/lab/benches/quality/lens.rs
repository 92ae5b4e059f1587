//! A thin-lens renderer that is exact for layers: the ground truth.
//!
//! For a planar surface 1/z, and with it the CoC c, is affine in picture coordinates p: c(p) = a + b.p. The ray
//! through pixel p and the lens point u (unit disc) meets the surface at p' = p + c(p') u, so
//! c(p') = c(p) / (1 - b.u): a closed form, without a search. (Potmesil and Chakravarty, SIGGRAPH 1981, for the CoC;
//! Cook, Porter and Carpenter, SIGGRAPH 1984, for sampling the lens.)

use bokehcam::bokeh::aperture::{Aperture, lens_points};
use glam::Vec2;

use super::picture::{Plane, Rgb};

/// Colour times alpha in linear light, and alpha.
pub type Rgba = [f32; 4];

/// Transmitted light below this fraction is neglected.
const OPAQUE: f32 = 1e-3;
/// Maximum number of surfaces in a scene.
const MAX_SURFACES: usize = 16;
/// Samples per pixel and axis of the pinhole picture.
const PINHOLE_SAMPLES: usize = 4;

/// A textured plane.
#[derive(Clone, Debug)]
pub struct Surface {
    /// CoC radius in pixels at the picture's centre.
    pub coc_px: f32,
    /// Change of the CoC radius per pixel to the right and downwards.
    pub slope: Vec2,
    /// Premultiplied texture; the surface continues with its border.
    pub texture: Plane<Rgba>,
    /// Texels by which the texture extends beyond the picture on every side.
    pub margin_px: usize,
}

/// A scene: surfaces in any order, and the lens.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// CoC radius of a point at infinity, in pixels; surfaces stay below it.
    pub coc_at_infinity_px: f32,
    /// The opening of the lens.
    pub aperture: Aperture,
    /// The surfaces, in any order.
    pub surfaces: Vec<Surface>,
}

/// A surface prepared for ray intersection.
struct PreparedSurface<'a> {
    surface: &'a Surface,
    /// CoC at pixel (0, 0).
    origin_px: f32,
    /// Texels with any alpha: first and last column and row.
    bounds: [f32; 4],
}

impl Surface {
    /// Returns the CoC radius at a position of the picture.
    pub fn coc_at(&self, p: Vec2, size: (usize, usize)) -> f32 {
        let middle = Vec2::new((size.0 - 1) as f32, (size.1 - 1) as f32) / 2.0;
        self.coc_px + self.slope.dot(p - middle)
    }

    fn prepare(&self, size: (usize, usize)) -> PreparedSurface<'_> {
        let (mut low, mut high) = (Vec2::splat(f32::INFINITY), Vec2::splat(f32::NEG_INFINITY));
        for (k, texel) in self.texture.data.iter().enumerate().filter(|(_, texel)| texel[3] > 0.0) {
            let at = Vec2::new((k % self.texture.width) as f32, (k / self.texture.width) as f32);
            (low, high) = (low.min(at), high.max(at));
            debug_assert!(texel[3] <= 1.0);
        }
        // A texture that is not empty at its border continues beyond it.
        let last = Vec2::new((self.texture.width - 1) as f32, (self.texture.height - 1) as f32);
        let far = f32::INFINITY;
        let below = |low: f32| if low <= 0.0 { -far } else { low - 1.0 };
        let above = |high: f32, last: f32| if high >= last { far } else { high + 1.0 };
        let bounds = [below(low.x), above(high.x, last.x), below(low.y), above(high.y, last.y)];
        PreparedSurface { surface: self, origin_px: self.coc_at(Vec2::ZERO, size), bounds }
    }
}

impl PreparedSurface<'_> {
    /// Samples the texture bilinearly; `None` where the surface is empty.
    #[inline]
    fn sample(&self, p: Vec2) -> Option<Rgba> {
        let texture = &self.surface.texture;
        let (x, y) = (p.x + self.surface.margin_px as f32, p.y + self.surface.margin_px as f32);
        let [left, right, top, bottom] = self.bounds;
        if !(x > left && x < right && y > top && y < bottom) {
            return None;
        }
        let x = x.clamp(0.0, (texture.width - 1) as f32);
        let y = y.clamp(0.0, (texture.height - 1) as f32);
        let (column, row) = ((x as usize).min(texture.width.max(2) - 2), (y as usize).min(texture.height.max(2) - 2));
        let (fx, fy) = (x - column as f32, y - row as f32);
        let at = row * texture.width + column;
        let (right, down) = (usize::from(texture.width > 1), if texture.height > 1 { texture.width } else { 0 });
        let (a, b) = (&texture.data[at], &texture.data[at + right]);
        let (c, d) = (&texture.data[at + down], &texture.data[at + down + right]);
        let mix = |k: usize| (a[k] + fx * (b[k] - a[k])) * (1.0 - fy) + (c[k] + fx * (d[k] - c[k])) * fy;
        Some([mix(0), mix(1), mix(2), mix(3)])
    }
}

impl Scene {
    /// Returns columns and rows.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Renders an ideal pinhole picture: sharp everywhere, antialiased by a box of one pixel.
    pub fn render_pinhole(&self) -> Plane<Rgb> {
        let places = (0..PINHOLE_SAMPLES * PINHOLE_SAMPLES).map(|k| {
            let within = |k: usize| (k as f32 + 0.5) / PINHOLE_SAMPLES as f32 - 0.5;
            (Vec2::new(within(k % PINHOLE_SAMPLES), within(k / PINHOLE_SAMPLES)), Vec2::ZERO)
        });
        self.render(&places.collect::<Vec<_>>())
    }

    /// Renders through the lens: the mean over about `rays` points of the aperture, each with its own offset in the
    /// pixel.
    pub fn render_thin_lens(&self, rays: usize) -> Plane<Rgb> {
        // Offsets in the pixel follow the R2 sequence (M. Roberts, 2018), which is evenly distributed at any length.
        let within = |k: usize, step: f64| ((k as f64 + 0.5) * step).fract() as f32 - 0.5;
        let point = |(k, u): (usize, glam::DVec2)| {
            (Vec2::new(within(k, 0.754_877_666_246_692_7), within(k, 0.569_840_290_998_053_3)), u.as_vec2())
        };
        let points = lens_points(&self.aperture, rays);
        self.render(&points.into_iter().enumerate().map(point).collect::<Vec<_>>())
    }

    /// Averages over rays, each an offset in the pixel and a point of the lens.
    fn render(&self, rays: &[(Vec2, Vec2)]) -> Plane<Rgb> {
        assert!(self.surfaces.len() <= MAX_SURFACES, "a scene has at most {MAX_SURFACES} surfaces");
        let targets: Vec<PreparedSurface> = self.surfaces.iter().map(|surface| surface.prepare(self.size())).collect();
        Plane::from_fn(self.width, self.height, |x, y| {
            let mut order: [usize; MAX_SURFACES] = std::array::from_fn(|k| k);
            let mut sum = [0.0; 3];
            for &(place, u) in rays {
                let p = Vec2::new(x as f32, y as f32) + place;
                let light = trace_ray(&targets, &mut order[..targets.len()], p, u);
                (0..3).for_each(|k| sum[k] += light[k]);
            }
            sum.map(|sum| sum / rays.len() as f32)
        })
    }

    /// Returns the CoC of the first surface that covers at least half of each pixel's centre.
    pub fn render_coc(&self) -> Plane<f32> {
        let targets: Vec<PreparedSurface> = self.surfaces.iter().map(|surface| surface.prepare(self.size())).collect();
        Plane::from_fn(self.width, self.height, |x, y| {
            let p = Vec2::new(x as f32, y as f32);
            let covering = targets.iter().filter(|target| target.sample(p).is_some_and(|texel| texel[3] >= 0.5));
            let nearest = covering.map(|target| target.surface.coc_at(p, self.size())).min_by(f32::total_cmp);
            nearest.unwrap_or(self.coc_at_infinity_px)
        })
    }
}

/// Returns the light along one ray, front to back. `order` starts as the previous ray's depth order, which is nearly
/// sorted.
#[inline]
fn trace_ray(targets: &[PreparedSurface], order: &mut [usize], p: Vec2, u: Vec2) -> Rgb {
    let mut coc_px = [0.0; MAX_SURFACES];
    for (coc_px, target) in coc_px.iter_mut().zip(targets) {
        let slope = target.surface.slope;
        *coc_px = (target.origin_px + slope.dot(p)) / (1.0 - slope.dot(u));
    }
    for k in 1..order.len() {
        let mut k = k;
        while k > 0 && coc_px[order[k]] < coc_px[order[k - 1]] {
            order.swap(k, k - 1);
            k -= 1;
        }
    }
    let (mut light, mut through) = ([0.0; 3], 1.0);
    for &index in order.iter() {
        let Some(texel) = targets[index].sample(p + coc_px[index] * u) else { continue };
        (0..3).for_each(|k| light[k] += through * texel[k]);
        through *= 1.0 - texel[3];
        if through < OPAQUE {
            break;
        }
    }
    light
}
