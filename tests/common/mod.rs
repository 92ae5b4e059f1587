//! Pictures, depth maps and settings for the tests of the blur.
#![allow(dead_code, missing_docs)]

use bokehcam::bokeh::aperture::{Aperture, Shape};
use bokehcam::bokeh::{Method, Settings};
use bokehcam::budget::Quality;
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::optics::CocKind;
use bokehcam::optics::{CocField, DepthCoc, Ramp};

/// A small pseudorandom generator, reproducible on every machine.
pub struct Numbers(pub u64);

impl Numbers {
    pub fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 40) as f32) / (1u64 << 24) as f32
    }
}

pub fn color(width: u32, height: u32, mut pixel: impl FnMut(u32, u32) -> [u8; 3]) -> ColorImage {
    let mut image = ColorImage::new(width, height);
    for (k, out) in image.rgb.chunks_exact_mut(3).enumerate() {
        out.copy_from_slice(&pixel(k as u32 % width, k as u32 / width));
    }
    image
}

pub fn depth(width: u32, height: u32, mut metres: impl FnMut(u32, u32) -> f32) -> DepthMap {
    let mut map = DepthMap::new(width, height);
    for (k, out) in map.metres.iter_mut().enumerate() {
        *out = metres(k as u32 % width, k as u32 / width);
    }
    map
}

pub fn noise(width: u32, height: u32) -> ColorImage {
    let mut numbers = Numbers(7);
    color(width, height, |_, _| std::array::from_fn(|_| (numbers.next() * 256.0) as u8))
}

/// Returns a pseudorandom byte that depends on the position alone.
pub fn grain(x: u32, y: u32) -> u8 {
    let mixed = (x.wrapping_mul(0x9E37_79B9) ^ y.wrapping_mul(0x85EB_CA6B)).wrapping_mul(0xC2B2_AE35);
    (mixed ^ (mixed >> 15)).wrapping_mul(0x27D4_EB2F).to_be_bytes()[0]
}

/// Returns the largest difference of two pictures, in codes.
pub fn codes_apart(a: &ColorImage, b: &ColorImage) -> u8 {
    assert_eq!(a.size(), b.size());
    a.rgb.iter().zip(&b.rgb).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or_default()
}

pub fn psnr_db(a: &ColorImage, b: &ColorImage) -> f64 {
    assert_eq!(a.size(), b.size());
    let squares = a.rgb.iter().zip(&b.rgb).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2));
    let mean = squares.sum::<f64>() / a.rgb.len() as f64;
    10.0 * (255.0 * 255.0 / mean.max(1e-9)).log10()
}

/// Returns three depths with sharp edges between them: a wall, a subject in focus, an object in front of it.
pub fn three_depths(width: u32, height: u32) -> DepthMap {
    depth(width, height, |x, y| {
        let (u, v) = (x as f32 / width as f32, y as f32 / height as f32);
        if u < 0.25 && v > 0.5 {
            0.6
        } else if (u - 0.5).abs() < 0.2 && v > 0.3 {
            1.0
        } else {
            3.0 + u
        }
    })
}

pub fn settings(coc: CocKind) -> Settings {
    Settings {
        coc,
        method: Method::Layered,
        aperture: Aperture::default(),
        rim: 0.2,
        rank: None,
        highlights: 0.0,
        quality: Quality::Balanced,
        adaptive: false,
        reuse: false,
        privacy: false,
        far_max_px: 12.0,
        near_max_px: if coc == CocKind::Depth { 18.0 } else { 0.0 },
    }
}

pub const DOF: CocField =
    CocField::Depth(DepthCoc { coc_at_infinity_px: 12.0, focus_m: 1.0, range_m: 0.0, max_coc_px: 18.0 });

pub fn coc(kind: CocKind, height: u32) -> CocField {
    match kind {
        CocKind::Uniform => CocField::Uniform { radius_px: 12.0 },
        CocKind::Ramp => CocField::Ramp(Ramp {
            normal: glam::Vec2::new(0.1, 0.995).normalize(),
            offset_px: height as f32 * 0.5,
            half_band_px: height as f32 * 0.1,
            slope: 0.2,
            max_px: 12.0,
        }),
        CocKind::Depth => DOF,
    }
}

pub const COC_KINDS: [CocKind; 3] = [CocKind::Uniform, CocKind::Ramp, CocKind::Depth];

pub fn shapes() -> Vec<Shape> {
    vec![
        Shape::Disc,
        Shape::Ring { inner: 0.5 },
        Shape::Polygon { blades: 5, rotation_deg: 20.0, curvature: 0.3 },
        Shape::Polygon { blades: 6, rotation_deg: 0.0, curvature: 0.0 },
        Shape::Heart,
        Shape::Star { points: 5 },
    ]
}
