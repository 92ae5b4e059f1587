//! Other methods, each in its plain published form and at full sampling density, regardless of cost.
//!
//! All take linear light and the signed CoC of every pixel, and repeat the picture's border.

use std::f32::consts::PI;

use bokehcam::bokeh::aperture::Shape;

use super::picture::{Plane, Rgb, for_each_row};

/// Area-normalised scattering: every pixel spreads over its own disc, without occlusion.
///
/// The classical renderer of BokehMe (Peng et al., CVPR 2022), with its weight
/// `(0.5 + 0.5 tanh(4 (R - d))) / (R^2 + 0.2)` at distance d; for a polygon d is taken relative to the outline.
pub fn scatter_blur(image: &Plane<Rgb>, coc_px: &Plane<f32>, shape: &Shape) -> Plane<Rgb> {
    let max_px = coc_px.data.iter().fold(0f32, |most, c| most.max(c.abs())) as i32 + 1;
    let (width, height) = (image.width as i32, image.height as i32);
    let mut out = vec![[0.0; 3]; image.data.len()];
    for_each_row(&mut out, image.width, |y, row| {
        let mut sums = vec![[0f32; 4]; row.len()];
        let y = y as i32;
        for from_y in (y - max_px).max(0)..=(y + max_px).min(height - 1) {
            for from_x in 0..width {
                let at = (from_y * width + from_x) as usize;
                let (radius_px, [r, g, b]) = (coc_px.data[at].abs(), image.data[at]);
                let (window, dy) = (radius_px as i32 + 1, y - from_y);
                if dy.abs() > window {
                    continue;
                }
                let share = 1.0 / (radius_px * radius_px + 0.2);
                for dx in (-window).max(-from_x)..=window.min(width - 1 - from_x) {
                    let inside_px = radius_px - support_px(shape, dx as f32, dy as f32, coc_px.data[at] < 0.0);
                    if inside_px < -1.5 {
                        continue;
                    }
                    let weight = share * if inside_px > 1.5 { 1.0 } else { 0.5 + 0.5 * (4.0 * inside_px).tanh() };
                    let sum = &mut sums[(from_x + dx) as usize];
                    *sum = [sum[0] + weight * r, sum[1] + weight * g, sum[2] + weight * b, sum[3] + weight];
                }
            }
        }
        for (out, sum) in row.iter_mut().zip(sums) {
            *out = [0, 1, 2].map(|k| sum[k] / sum[3].max(1e-9));
        }
    });
    Plane { data: out, ..*image }
}

/// Returns the distance from the centre in units in which the outline of a radius R lies at R. A near point shows the
/// shape rotated by 180 degrees.
fn support_px(shape: &Shape, dx: f32, dy: f32, near: bool) -> f32 {
    let distance_px = (dx * dx + dy * dy).sqrt();
    let Shape::Polygon { blades, rotation_deg, .. } = *shape else { return distance_px };
    let (half, turn) = (PI / blades as f32, if near { PI } else { 0.0 });
    let from_corner = (dy.atan2(dx) + turn - PI - rotation_deg.to_radians()).rem_euclid(2.0 * half);
    distance_px * (from_corner - half).cos() / half.cos()
}

/// Golden-angle gathering: along a spiral over the largest disc, a sample counts if its own CoC covers the pixel; for a
/// sample behind the pixel the CoC is limited to twice the pixel's.
///
/// D. Gustafsson, *Bokeh depth of field in a single pass* (2018), also Godot's circular bokeh.
pub fn golden_angle_blur(image: &Plane<Rgb>, coc_px: &Plane<f32>) -> Plane<Rgb> {
    /// Distance between samples, in pixels. At 1/3 there are more samples than pixels.
    const PITCH: f32 = 1.0 / 3.0;
    let golden = PI * (3.0 - 5f32.sqrt());
    let max_px = coc_px.data.iter().fold(0f32, |most, c| most.max(c.abs()));
    let mut spiral = Vec::new();
    let (mut radius_px, mut angle) = (PITCH, 0f32);
    while radius_px < max_px {
        spiral.push((angle.cos() * radius_px, angle.sin() * radius_px, radius_px));
        angle += golden;
        radius_px += PITCH / radius_px;
    }
    Plane::from_fn(image.width, image.height, |x, y| {
        let (x, y) = (x as i32, y as i32);
        let own_px = coc_px.at(x, y);
        let (mut sum, mut count) = (image.at(x, y), 1.0);
        for &(dx, dy, radius_px) in &spiral {
            let at = (x + dx.round() as i32, y + dy.round() as i32);
            let sample_px = coc_px.at(at.0, at.1);
            let reach_px = if sample_px > own_px { sample_px.abs().min(2.0 * own_px.abs()) } else { sample_px.abs() };
            let t = (reach_px - radius_px + 0.5).clamp(0.0, 1.0);
            let counts = t * t * (3.0 - 2.0 * t);
            let color = image.at(at.0, at.1);
            sum = [0, 1, 2].map(|k| sum[k] + sum[k] / count + counts * (color[k] - sum[k] / count));
            count += 1.0;
        }
        sum.map(|sum| sum / count)
    })
}

/// Gathering with a Gaussian of the disc's variance, sigma = R/2, cut at 3 sigma: the usual soft background blur.
pub fn gaussian_blur(image: &Plane<Rgb>, coc_px: &Plane<f32>) -> Plane<Rgb> {
    gather(
        image,
        |x, y| coc_px.at(x, y).abs(),
        1.5,
        |_, _| 1.0,
        |distance_px, radius_px| (-2.0 * distance_px * distance_px / (radius_px * radius_px).max(1e-6)).exp(),
    )
    .map(|[r, g, b, _]| [r, g, b])
}

/// Depth-aware blending of smoothed images: the picture and three Gaussian-smoothed copies of it, up to the largest CoC;
/// each pixel is a blend of the two between which its own CoC lies.
///
/// S. Dutta, *Depth-aware blending of smoothed images for bokeh effect generation* (2021), with exact depth in place of
/// the blending weights that a network derives from it.
pub fn blended_blur(image: &Plane<Rgb>, coc_px: &Plane<f32>) -> Plane<Rgb> {
    const COPIES: usize = 3;
    let max_px = coc_px.data.iter().fold(0f32, |most, c| most.max(c.abs())).max(1e-3);
    let radius_px = |copy: usize| max_px * copy as f32 / COPIES as f32;
    let copies: Vec<Plane<Rgb>> = (0..=COPIES)
        .map(|copy| if copy == 0 { image.clone() } else { smooth_gaussian(image, 0.5 * radius_px(copy)) })
        .collect();
    Plane::from_fn(image.width, image.height, |x, y| {
        let at = y * image.width + x;
        let place = coc_px.data[at].abs() / max_px * COPIES as f32;
        let below = (place as usize).min(COPIES - 1);
        let (a, b, share) = (copies[below].data[at], copies[below + 1].data[at], place - below as f32);
        [0, 1, 2].map(|k| a[k] + share * (b[k] - a[k]))
    })
}

/// Applies a separable Gaussian of `sigma_px`, cut at 3 sigma.
pub fn smooth_gaussian(image: &Plane<Rgb>, sigma_px: f32) -> Plane<Rgb> {
    let reach = (3.0 * sigma_px).ceil() as i32;
    let taps: Vec<f32> = (-reach..=reach).map(|d| (-0.5 * (d as f32 / sigma_px).powi(2)).exp()).collect();
    let all: f32 = taps.iter().sum();
    let along = |of: &Plane<Rgb>, dx: i32, dy: i32| {
        Plane::from_fn(of.width, of.height, |x, y| {
            let mut sum = [0.0; 3];
            for (tap, d) in taps.iter().zip(-reach..) {
                let color = of.at(x as i32 + d * dx, y as i32 + d * dy);
                (0..3).for_each(|k| sum[k] += tap / all * color[k]);
            }
            sum
        })
    };
    along(&along(image, 1, 0), 0, 1)
}

/// Classic near, focus and far layers: far pixels gathered from far pixels alone, near ones with the largest near CoC
/// around and their own coverage, both premultiplied and stacked by `mix`.
///
/// The common form behind K. Takahashi's KinoBokeh, Unity's post-processing stack and K. Garcia (SIGGRAPH 2017), with
/// exact discs instead of sparse samples or separable filters.
pub fn near_focus_far_blur(image: &Plane<Rgb>, coc_px: &Plane<f32>) -> Plane<Rgb> {
    let disc = |distance_px: f32, radius_px: f32| (radius_px + 0.5 - distance_px).clamp(0.0, 1.0);
    let is_far = |x, y| coc_px.at(x, y).clamp(0.0, 1.0);
    let is_near = |x, y| (-coc_px.at(x, y)).clamp(0.0, 1.0);
    let far = gather(image, |x, y| coc_px.at(x, y).max(0.0), 1.0, is_far, disc);
    let near_px = dilate_max(&coc_px.map(|c| (-c).max(0.0)));
    let near = gather(image, |x, y| near_px.at(x, y), 1.0, is_near, disc);
    Plane::from_fn(image.width, image.height, |x, y| {
        let (at, (x, y)) = (y * image.width + x, (x as i32, y as i32));
        let (far, near, is_far) = (far.data[at], near.data[at], is_far(x, y));
        let sharp = image.at(x, y);
        [0, 1, 2].map(|k| {
            let back = sharp[k] + is_far * (far[k] - sharp[k]);
            back + near[3] * (near[k] - back)
        })
    })
}

/// Gathers: returns the mean colour, weighted by `share(x, y)` of the sample times `weight(distance, radius)` out to
/// `extent` radii, and the fraction of the total weight that was used.
fn gather(
    image: &Plane<Rgb>,
    radius_px: impl Fn(i32, i32) -> f32 + Sync,
    extent: f32,
    share: impl Fn(i32, i32) -> f32 + Sync,
    weight: impl Fn(f32, f32) -> f32 + Sync,
) -> Plane<[f32; 4]> {
    Plane::from_fn(image.width, image.height, |x, y| {
        let (x, y) = (x as i32, y as i32);
        let radius_px = radius_px(x, y);
        let reach = (radius_px * extent + 0.5) as i32;
        let (mut sum, mut all) = ([0.0; 4], 0.0);
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                let weight = weight(((dx * dx + dy * dy) as f32).sqrt(), radius_px);
                if weight > 0.0 {
                    let (share, color) = (weight * share(x + dx, y + dy), image.at(x + dx, y + dy));
                    (0..3).for_each(|k| sum[k] += share * color[k]);
                    (sum[3], all) = (sum[3] + share, all + weight);
                }
            }
        }
        let [r, g, b] = [0, 1, 2].map(|k| if sum[3] > 1e-6 { sum[k] / sum[3] } else { image.at(x, y)[k] });
        [r, g, b, sum[3] / all]
    })
}

/// Returns the largest value in a square around each pixel, whose radius is the largest value of all.
fn dilate_max(values: &Plane<f32>) -> Plane<f32> {
    let reach = values.data.iter().copied().fold(0.0, f32::max).ceil() as i32;
    let rows = Plane::from_fn(values.width, values.height, |x, y| {
        (-reach..=reach).map(|d| values.at(x as i32 + d, y as i32)).fold(0.0, f32::max)
    });
    Plane::from_fn(values.width, values.height, |x, y| {
        (-reach..=reach).map(|d| rows.at(x as i32, y as i32 + d)).fold(0.0, f32::max)
    })
}
