//! Renders a scene through a pinhole or a thin lens.

use std::sync::{Mutex, PoisonError};

use glam::{DVec2, Vec2, Vec3};

use super::ray::Ray;
use super::{PosedScene, Scene};
use bokehcam::color::encode_srgb;
use bokehcam::frame::{ColorImage, DepthMap, Mask};

/// A camera: picture size, focal length, and position in a rectified pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Focal length in pixels, for this width.
    pub focal_px: f32,
    /// Position of the camera along `x`: 0 for the left (or only) one, the baseline in metres for the right one.
    pub camera_offset_m: f32,
}

impl View {
    /// Creates the view that the portrait was composed for: the focal length equals the picture's width (53 degrees).
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height, focal_px: width as f32, camera_offset_m: 0.0 }
    }

    /// Returns this camera moved to the right by `baseline_m`.
    pub fn right_camera(self, baseline_m: f32) -> Self {
        Self { camera_offset_m: self.camera_offset_m + baseline_m, ..self }
    }

    /// Returns column and row of the optical axis; pixel centres are at integers.
    pub fn principal_point_px(&self) -> Vec2 {
        0.5 * Vec2::new(self.width as f32 - 1.0, self.height as f32 - 1.0)
    }

    /// Returns where the ray of the picture position `p_px` meets the plane at unit depth, relative to the camera.
    fn ray_slope(&self, p_px: Vec2) -> Vec2 {
        let q = (p_px - self.principal_point_px()) / self.focal_px;
        Vec2::new(q.x, -q.y)
    }

    fn camera_position(&self) -> Vec3 {
        self.camera_offset_m * Vec3::X
    }

    fn pinhole_ray(&self, p_px: Vec2) -> Ray {
        Ray::new(self.camera_position(), self.ray_slope(p_px).extend(1.0))
    }

    /// Returns the ray that leaves the lens at `lens_m` (right and up of its centre) and meets the pinhole ray at the
    /// focal plane.
    fn lens_ray(&self, p_px: Vec2, lens_m: Vec2, focus_m: f32) -> Ray {
        let direction = self.ray_slope(p_px) - lens_m / focus_m;
        Ray::new(self.camera_position() + lens_m.extend(0.0), direction.extend(1.0))
    }
}

/// A thin lens: a point at depth `z` becomes an image of the aperture with radius `c = coc_at_infinity_px (1 - focus_m
/// / z)` px, upright behind the focal plane (`c > 0`) and rotated by 180 degrees in front of it.
#[derive(Clone, Copy, Debug)]
pub struct ThinLens<'a> {
    /// CoC radius of a point at infinity, in pixels of the view.
    pub coc_at_infinity_px: f32,
    /// Depth of the focal plane, in metres, > 0.
    pub focus_m: f32,
    /// Lens points `u` in the unit disc (x right, y down), evenly distributed over the opening, one per ray: pixel `p`
    /// sees depth `z` at `p + c(z) u`. A blur is smooth if its disc has no more pixels than there are points.
    pub aperture: &'a [DVec2],
}

/// Linear light: `height` x `width`, row-major, 1 = white, not clipped.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearImage {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `height * width` radiances (R, G, B), >= 0.
    pub rgb: Vec<Vec3>,
}

impl LinearImage {
    fn black(view: &View) -> Self {
        let (width, height) = (view.width, view.height);
        Self { width, height, rgb: vec![Vec3::ZERO; width as usize * height as usize] }
    }

    /// Returns the picture as 8-bit sRGB, clipped to white.
    pub fn to_srgb(&self) -> ColorImage {
        let mut image = ColorImage::new(self.width, self.height);
        for (bytes, light) in image.rgb.chunks_exact_mut(3).zip(&self.rgb) {
            bytes.copy_from_slice(&light.to_array().map(encode_srgb));
        }
        image
    }
}

/// One picture through a lens, in two versions.
#[derive(Clone, Debug, PartialEq)]
pub struct LensPicture {
    /// Rays are clipped to white before averaging: the best blur that the 8-bit picture allows.
    pub clipped: LinearImage,
    /// Rays are not clipped: the result of a real lens.
    pub hdr: LinearImage,
}

/// Returns the offset of ray `k` in its pixel, in -0.5..0.5; ray 0 goes through the centre.
fn pinhole_jitter(k: u32) -> Vec2 {
    // The most uniform additive sequence of the plane (M. Roberts' R2).
    additive_sequence(k, 0.754_877_666_246_692_8, 0.569_840_290_998_053_3)
}

/// Returns offsets like [`pinhole_jitter`], with steps that do not correlate with the lens points of the same index.
fn lens_jitter(k: u32) -> Vec2 {
    additive_sequence(k, std::f64::consts::SQRT_2, 1.732_050_807_568_877_2)
}

/// Returns point `k` of an additive sequence (multiples of the steps modulo 1), in -0.5..0.5.
fn additive_sequence(k: u32, step_x: f64, step_y: f64) -> Vec2 {
    let wrap = |step: f64| ((f64::from(k) * step + 0.5).fract() - 0.5) as f32;
    Vec2::new(wrap(step_x), wrap(step_y))
}

impl Scene {
    /// Renders through a pinhole: `samples_per_pixel` (>= 1) rays per pixel, each clipped to white, averaged in linear
    /// light; and the exact depth of every pixel centre (0 where there is nothing). Both are resized to the view. The
    /// result does not depend on `threads` (>= 1).
    pub fn render_pinhole(
        &self,
        view: &View,
        time_s: f64,
        samples_per_pixel: u32,
        threads: usize,
        color: &mut ColorImage,
        depth: &mut DepthMap,
    ) {
        color.resize(view.width, view.height);
        depth.resize(view.width, view.height);
        if view.width == 0 || view.height == 0 {
            return;
        }
        let posed = self.pose_at(time_s);
        let jitter: Vec<Vec2> = (0..samples_per_pixel.max(1)).map(pinhole_jitter).collect();
        let width = view.width as usize;
        let rows = color.rgb.chunks_exact_mut(3 * width).zip(depth.metres.chunks_exact_mut(width)).enumerate();
        for_each_parallel(rows, threads, |(row, (bytes, metres))| {
            for (column, (bytes, metres)) in bytes.chunks_exact_mut(3).zip(metres).enumerate() {
                let (light, depth_m) = posed.pinhole_pixel(view, Vec2::new(column as f32, row as f32), &jitter);
                bytes.copy_from_slice(&light.to_array().map(encode_srgb));
                *metres = depth_m;
            }
        });
    }

    /// Renders the person's alpha per pixel, 0 to 1, with the same rays as [`Self::render_pinhole`].
    pub fn render_coverage(&self, view: &View, time_s: f64, samples_per_pixel: u32, threads: usize) -> Mask {
        let mut mask = Mask::default();
        mask.resize(view.width, view.height);
        if view.width == 0 || view.height == 0 {
            return mask;
        }
        let posed = self.pose_at(time_s);
        let jitter: Vec<Vec2> = (0..samples_per_pixel.max(1)).map(pinhole_jitter).collect();
        let rows = mask.alpha.chunks_exact_mut(view.width as usize).enumerate();
        for_each_parallel(rows, threads, |(row, alphas)| {
            for (column, alpha) in alphas.iter_mut().enumerate() {
                let centre = Vec2::new(column as f32, row as f32);
                let is_subject = |offset: &&Vec2| {
                    let hit = posed.intersect(&view.pinhole_ray(centre + **offset));
                    hit.is_some_and(|hit| self.parts[hit.part].is_subject)
                };
                *alpha = jitter.iter().filter(is_subject).count() as f32 / jitter.len() as f32;
            }
        });
        mask
    }

    /// Renders through a thin lens: one ray per aperture point and pixel, averaged in linear light over pixel and lens.
    /// The result does not depend on `threads`; an aperture without points gives black.
    pub fn render_thin_lens(&self, view: &View, time_s: f64, lens: &ThinLens, threads: usize) -> LensPicture {
        let mut picture = LensPicture { clipped: LinearImage::black(view), hdr: LinearImage::black(view) };
        if lens.aperture.is_empty() || view.width == 0 {
            return picture;
        }
        // A ray through the lens at -u is offset by focal_px * radius_m * (1 / focus_m - 1 / z) u px at depth z, which
        // is c(z) u.
        let radius_m = lens.coc_at_infinity_px * lens.focus_m / view.focal_px;
        let posed = self.pose_at(time_s);
        let samples: Vec<(Vec2, Vec2)> = (0..)
            .zip(lens.aperture)
            .map(|(k, u)| (lens_jitter(k), radius_m * Vec2::new(-u.x as f32, u.y as f32)))
            .collect();
        let width = view.width as usize;
        let rows = picture.clipped.rgb.chunks_exact_mut(width).zip(picture.hdr.rgb.chunks_exact_mut(width));
        for_each_parallel(rows.enumerate(), threads, |(row, (clipped, hdr))| {
            for (column, (clipped, hdr)) in clipped.iter_mut().zip(hdr).enumerate() {
                let centre = Vec2::new(column as f32, row as f32);
                for (jitter, lens_m) in &samples {
                    let (light, _) = posed.trace_ray(&view.lens_ray(centre + *jitter, *lens_m, lens.focus_m));
                    *clipped += light.min(Vec3::ONE);
                    *hdr += light;
                }
                *clipped /= samples.len() as f32;
                *hdr /= samples.len() as f32;
            }
        });
        picture
    }
}

impl PosedScene<'_> {
    /// Returns the mean of the pixel's rays, each clipped to white, and the depth along the first one, through the
    /// centre.
    fn pinhole_pixel(&self, view: &View, centre: Vec2, jitter: &[Vec2]) -> (Vec3, f32) {
        let (mut sum, mut depth_m) = (Vec3::ZERO, 0.0);
        for (k, offset) in jitter.iter().enumerate() {
            let (light, z_m) = self.trace_ray(&view.pinhole_ray(centre + *offset));
            sum += light.min(Vec3::ONE);
            if k == 0 {
                depth_m = z_m;
            }
        }
        (sum / jitter.len() as f32, depth_m)
    }
}

/// Runs `work` for every item on `threads` threads, the caller's included.
fn for_each_parallel<T: Send>(items: impl Iterator<Item = T> + Send, threads: usize, work: impl Fn(T) + Sync) {
    let items = Mutex::new(items);
    let run = || {
        // The block releases the lock before the work begins.
        while let Some(item) = { items.lock().unwrap_or_else(PoisonError::into_inner).next() } {
            work(item);
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(run);
        }
        run();
    });
}
